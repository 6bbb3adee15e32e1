"""What the fine stage sets out with: coarse Gaussians, and for native 4D one set per time slice.

Axes: ``n`` Gaussians, ``p`` points. A pulse cannot show what the whole time range shows, so that
moving things need Gaussians in every slice. Where the capture has depth they are put on the pixels
of that time which the standing Gaussians do not explain; elsewhere the moving ones are repeated.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.capture.capture import PointCloud
from diff4splat.fitting.canonical import raw_points
from diff4splat.fitting.frame_renderer import Sight
from diff4splat.fitting.lens_points import lifted
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.motions.spacetime import Pulses
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.pictures import FrameStore, Schedule
from diff4splat.fitting.settings import FitSettings
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

OVERLAP = 0.6
"""Deviation of a starting pulse over the distance between pulses."""
SLICES_SHARE = 0.75
"""Of the budget, for all Gaussians at the start: the rest is room to split."""
UNEXPLAINED = 0.06
"""Mean colour error of a pixel that standing Gaussians do not explain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Departure:
    """What the fine stage begins with."""

    rows: dict[str, Tensor]
    moves: Bool[Tensor, " n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """Where the pictures come from."""

    sight: Sight
    store: FrameStore
    schedule: Schedule
    settings: FitSettings
    known: CameraModel | None = None
    """What was learned of the cameras."""


def depart(
    model: SceneModel, moves: Bool[Tensor, " n"], motion: LearnedMotion, around: Surroundings
) -> Departure:
    """The Gaussians of the coarse stage; native 4D has moving ones once per time slice."""
    rows = model.rows(torch.arange(len(model)))
    if not isinstance(motion, Pulses) or not bool(moves.any()):
        return Departure(rows=rows, moves=moves)
    still = (~moves).nonzero().flatten()
    standing = {name: value[still] for name, value in rows.items()} | motion.columns(len(still))
    moving = {name: value[moves] for name, value in rows.items()}
    room = max(int(SLICES_SHARE * around.settings.density.budget) - len(still), 2)
    seen = model.canonical(around.settings.harmonics).select(still)
    slices = _found(seen, motion, around, room) or _repeated(moving, around.settings, room)
    parts = [standing]
    for number, here in enumerate(slices):
        parts.append(here | _pulses(motion, len(here["means"]), number, len(slices)))
    joined = {name: torch.cat([part[name] for part in parts]) for name in standing}
    return Departure(rows=joined, moves=torch.arange(len(joined["means"])) >= len(still))


def _found(
    standing: Gaussians, motion: Pulses, around: Surroundings, room: int
) -> list[dict[str, Tensor]] | None:
    """What depth shows in each slice; None where one has none."""
    count = around.settings.time_slices
    if not around.settings.use_depth:
        return None
    slices = []
    for number in range(count):
        center_s = motion.start_s + motion.duration_s * (number + 0.5) / count
        points = _unexplained(standing, around, center_s, max(room // count, 1))
        if points is None:
            return None
        slices.append(points)
    return slices


def _repeated(
    moving: dict[str, Tensor], settings: FitSettings, room: int
) -> list[dict[str, Tensor]]:
    """The moving Gaussians in each slice; in fewer slices, and not all, where room is short."""
    total = len(moving["means"])
    count = min(max(room // total, 2), settings.time_slices)
    generator = torch.Generator().manual_seed(settings.seed)
    slices = []
    for _ in range(count):
        some = torch.randperm(total, generator=generator)[: max(room // count, 1)]
        slices.append({name: value[some] for name, value in moving.items()})
    return slices


def _pulses(motion: Pulses, count: int, number: int, slices: int) -> dict[str, Tensor]:
    center_s = motion.start_s + motion.duration_s * (number + 0.5) / slices
    deviation_s = OVERLAP * motion.duration_s / slices
    return dict(motion.columns(count)) | {
        "time_centers_s": torch.full((count,), center_s),
        "log_deviations": torch.full((count,), math.log(deviation_s)),
    }


@torch.no_grad()
def _unexplained(
    standing: Gaussians, around: Surroundings, time_s: float, count: int
) -> dict[str, Tensor] | None:
    """Points on pixels near a time that ``standing`` gets wrong; None without depth."""
    nearest_s = min(around.schedule.times_s, key=lambda other_s: abs(other_s - time_s))
    frames = around.schedule.frames_at[nearest_s]
    clouds = [_wrong_pixels(standing, around, index) for index in frames]
    if any(cloud is None for cloud in clouds):
        return None
    positions = torch.cat([cloud.positions for cloud in clouds])
    if len(positions) == 0:
        return None
    generator = torch.Generator().manual_seed(around.settings.seed)
    drawn = torch.randperm(len(positions), generator=generator)[:count]
    rgb = torch.cat([cloud.rgb for cloud in clouds])
    points = PointCloud(positions=positions[drawn], rgb=rgb[drawn])
    return raw_points(points, around.settings.harmonics)


def _wrong_pixels(standing: Gaussians, around: Surroundings, index: int) -> PointCloud | None:
    frame, sight = around.store.read(index), around.sight
    if frame.depth is None:
        return None
    camera = sight.camera(index, around.known)
    if sight.traced:
        made = sight.standing(standing, camera, index).rgb
    else:
        settings = RenderSettings(background=sight.background)
        made = render(standing, sight.capture.cameras[index], settings=settings).rgb
    points, known = lifted(camera, frame.depth)
    wrong = ((made - frame.rgb).abs().mean(-1) > UNEXPLAINED) & known
    if frame.counts is not None:
        wrong = wrong & frame.counts
    return PointCloud(positions=points[wrong], rgb=frame.rgb[wrong])
