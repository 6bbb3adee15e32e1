"""Trivial baselines without a model.

Axes: ``h w`` pixels, ``n`` points, ``t`` times. Baselines get the same input as the system: the
first image, or for reconstruction the input frames, of which each target time uses the nearest. The
best plane is an oracle: it selects its depth with the ground truth, and bounds what one constant
depth can reach.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.protocols.protocol import PlaneSearch
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.systems.homography import plane_depth, warp_plane
from diff4splat.evaluation.systems.predictions import PointQuery, Prediction, RenderedView
from diff4splat.geometry.camera import Camera
from diff4splat.metrics.image import psnr
from diff4splat.scene.scene import Scene
from diff4splat.training.batches.normalise_scale import valid_depth

NEAREST, BEST_PLANE, MEAN_PLANE = "nearest frame", "best plane (oracle)", "mean-depth plane"
ZERO_MOTION = "zero motion"
BASELINES = (NEAREST, BEST_PLANE, MEAN_PLANE, ZERO_MOTION)
"""Rows of the table, in order."""


class NoScene:
    """No scene, and by default no motion."""

    @property
    def scene(self) -> Scene | None:
        """None."""
        return None

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"] | None:
        """None."""
        del query


@dataclass(frozen=True)
class NearestFrame(NoScene):
    """The input image nearest in time, for any camera."""

    sample: EvalSample

    def render(self, camera: Camera, time_s: float, frame: int) -> RenderedView:
        """That image; no depth."""
        del camera, time_s
        return RenderedView(rgb=self.sample.input_rgb(self.sample.nearest_input(frame)), depth=None)


@dataclass(frozen=True)
class PlanarImage(NoScene):
    """The input image nearest in time, on a plane in front of its camera."""

    sample: EvalSample
    depth: float

    def render(self, camera: Camera, time_s: float, frame: int) -> RenderedView:
        """The plane as ``camera`` sees it."""
        del time_s
        source = self.sample.input_view.cameras[self.sample.nearest_input(frame)]
        depth = plane_depth(source, camera, self.depth)
        return RenderedView(rgb=self.rgb(camera, frame), depth=depth)

    def rgb(self, camera: Camera, frame: int) -> Float[Tensor, "h w 3"]:
        """Colour alone."""
        nearest = self.sample.nearest_input(frame)
        source = self.sample.input_view.cameras[nearest]
        return warp_plane(self.sample.input_rgb(nearest), source, camera, self.depth)


@dataclass(frozen=True)
class ZeroMotion(NoScene):
    """Static points; no images."""

    def render(self, camera: Camera, time_s: float, frame: int) -> RenderedView | None:
        """None."""
        del camera, time_s, frame

    def offsets(self, query: PointQuery) -> Float[Tensor, "t n 3"]:
        """Zeros."""
        return torch.zeros(len(query.times_s), len(query.cells), 3)


def make_baseline(name: str, sample: EvalSample, planes: PlaneSearch) -> Prediction:
    """Prediction of one baseline.

    Raises:
        InputError: a plane for a clip without depth.
    """
    if name == NEAREST:
        return NearestFrame(sample)
    if name == ZERO_MOTION:
        return ZeroMotion()
    depth = best_depth(sample, planes) if name == BEST_PLANE else mean_depth(sample)
    return PlanarImage(sample, depth)


def mean_depth(sample: EvalSample) -> float:
    """Mean depth of the first input image.

    Raises:
        InputError: the clip has no depth.
    """
    return float(_first_depths(sample).mean())


def best_depth(sample: EvalSample, planes: PlaneSearch) -> float:
    """The candidate with the highest mean PSNR over the target images; the nearer of equal ones.

    Raises:
        InputError: the clip has no depth.
    """
    median = float(_first_depths(sample).median())
    first, last = torch.tensor([planes.nearest, planes.farthest]).double().log()
    depths = (median * torch.linspace(first, last, planes.candidates).exp()).tolist()
    return max(depths, key=lambda depth: _mean_psnr(sample, depth))


def _mean_psnr(sample: EvalSample, depth: float) -> float:
    plane = PlanarImage(sample, depth)
    rgb = [plane.rgb(sample.camera(pair), pair[1]) for pair in sample.targets.pairs]
    truth = torch.stack([sample.true_rgb(pair) for pair in sample.targets.pairs])
    return float(psnr(torch.stack(rgb), truth).clamp_max(PSNR_CAP_DB).mean())


def _first_depths(sample: EvalSample) -> Float[Tensor, " n"]:
    depth = sample.input_view.depth[0].float()
    valid = valid_depth(depth)
    if not sample.has_depth:
        raise InputError("plane: expected depth in the first input frame, got none; it is skipped")
    return depth[valid]
