"""Answers that need no model. A system that does not beat them has learnt nothing of the clip.

Axes: ``h w`` pixels, ``n`` points, ``t`` times. All see what the system under test sees: the first
picture, or for reconstruction the given frames of the input video, of which each judged time gets
the nearest. The best plane chooses its depth by looking at the truth: an oracle, a bound on what
one constant depth can do.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.homography import plane_depth, warp_plane
from diff4splat.evaluation.predictions import Answer, Look, PointQuery
from diff4splat.evaluation.protocol import PlaneSearch
from diff4splat.evaluation.sample import Case
from diff4splat.geometry.camera import Camera
from diff4splat.metrics.image import psnr
from diff4splat.scene.scene import Scene
from diff4splat.training.batches.normalise_scale import valid_depth

NEAREST, BEST_PLANE, MEAN_PLANE = "nearest frame", "best plane (oracle)", "mean-depth plane"
ZERO_MOTION = "zero motion"
BASELINES = (NEAREST, BEST_PLANE, MEAN_PLANE, ZERO_MOTION)
"""Rows of the table, in order."""


class _Trivial:
    """No scene, and by default no idea of motion."""

    @property
    def scene(self) -> Scene | None:
        """None."""
        return None

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"] | None:
        """None."""
        del query


@dataclass(frozen=True)
class NearestFrame(_Trivial):
    """The given picture nearest in time, whoever looks."""

    case: Case

    def look(self, camera: Camera, time_s: float, frame: int) -> Look:
        """That picture; no depth."""
        del camera, time_s
        return Look(rgb=self.case.input_rgb(self.case.nearest_input(frame)), depth=None)


@dataclass(frozen=True)
class PlanePicture(_Trivial):
    """The given picture nearest in time on a plane before its own camera."""

    case: Case
    depth: float

    def look(self, camera: Camera, time_s: float, frame: int) -> Look:
        """The plane as ``camera`` sees it."""
        del time_s
        own = self.case.input_view.cameras[self.case.nearest_input(frame)]
        return Look(rgb=self.picture(camera, frame), depth=plane_depth(own, camera, self.depth))

    def picture(self, camera: Camera, frame: int) -> Float[Tensor, "h w 3"]:
        """Colour alone."""
        source = self.case.nearest_input(frame)
        own = self.case.input_view.cameras[source]
        return warp_plane(self.case.input_rgb(source), own, camera, self.depth)


@dataclass(frozen=True)
class ZeroMotion(_Trivial):
    """Points that stay; it shows nothing."""

    def look(self, camera: Camera, time_s: float, frame: int) -> Look | None:
        """None."""
        del camera, time_s, frame

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"]:
        """Zeros."""
        return torch.zeros(len(query.times_s), len(query.cells), 3)


def make_baseline(name: str, case: Case, planes: PlaneSearch) -> Answer:
    """The answer of one row.

    Raises:
        InputError: a plane for a clip without depth.
    """
    if name == NEAREST:
        return NearestFrame(case)
    if name == ZERO_MOTION:
        return ZeroMotion()
    depth = best_depth(case, planes) if name == BEST_PLANE else mean_depth(case)
    return PlanePicture(case, depth)


def mean_depth(case: Case) -> float:
    """Of the first given picture.

    Raises:
        InputError: there is none.
    """
    return float(_first_depths(case).mean())


def best_depth(case: Case, planes: PlaneSearch) -> float:
    """The candidate with the highest mean PSNR over the judged pictures; the nearer of equals.

    Raises:
        InputError: the clip has no depth to search around.
    """
    median = float(_first_depths(case).median())
    first, last = torch.tensor([planes.nearest, planes.farthest]).double().log()
    depths = (median * torch.linspace(first, last, planes.candidates).exp()).tolist()
    return max(depths, key=lambda depth: _mean_psnr(case, depth))


def _mean_psnr(case: Case, depth: float) -> float:
    answer = PlanePicture(case, depth)
    seen = [answer.picture(case.camera(pair), pair[1]) for pair in case.judged.pairs]
    truth = torch.stack([case.true_rgb(pair) for pair in case.judged.pairs])
    return float(psnr(torch.stack(seen), truth).clamp_max(PSNR_CAP_DB).mean())


def _first_depths(case: Case) -> Float[Tensor, " n"]:
    depth = case.input_view.depth[0].float()
    valid = valid_depth(depth)
    if not case.has_depth:
        raise InputError("plane: expected depth in the first input frame, got none; it is skipped")
    return depth[valid]
