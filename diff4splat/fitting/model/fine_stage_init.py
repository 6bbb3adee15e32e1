"""Initial Gaussians of the fine stage; native 4D Gaussians get one set per time slice.

Axes: ``n`` Gaussians, ``p`` points. A native 4D Gaussian is visible for a short time, so moving
content needs Gaussians in every slice. With depth they start on pixels of that time that the static
Gaussians explain badly. Without depth the moving Gaussians are repeated per slice.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.capture.capture import PointCloud
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.frames.unprojection import unproject
from diff4splat.fitting.model.canonical import params_from_points
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.motions.spacetime import SpacetimeGaussians
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.settings import FitSettings
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians

SLICE_OVERLAP = 0.6
"""Initial temporal deviation divided by the length of a slice."""
INITIAL_BUDGET_SHARE = 0.75
"""Share of the budget that the initial Gaussians may use; splits need the rest."""
MIN_COLOR_ERROR = 0.06
"""Mean colour error of a pixel that the static Gaussians do not explain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FineStageInit:
    """Parameters at the start of the fine stage."""

    rows: dict[str, Tensor]
    moving_mask: Bool[Tensor, " n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class InitContext:
    """Frames, their renderer and the settings of the fit."""

    renderer: FrameRenderer
    store: FrameStore
    schedule: FrameSchedule
    settings: FitSettings
    cameras: CameraModel | None = None
    """Cameras as optimised by the coarse stage."""


def init_fine_stage(
    model: SceneModel,
    moving_mask: Bool[Tensor, " n"],
    motion: LearnedMotion,
    context: InitContext,
) -> FineStageInit:
    """The Gaussians of the coarse stage; native 4D repeats the moving ones per time slice."""
    rows = model.rows(torch.arange(len(model)))
    if not isinstance(motion, SpacetimeGaussians) or not bool(moving_mask.any()):
        return FineStageInit(rows=rows, moving_mask=moving_mask)
    static = (~moving_mask).nonzero().flatten()
    static_rows = {name: value[static] for name, value in rows.items()}
    static_rows |= motion.columns(len(static))
    moving_rows = {name: value[moving_mask] for name, value in rows.items()}
    limit = max(int(INITIAL_BUDGET_SHARE * context.settings.density.budget) - len(static), 2)
    gaussians = model.canonical(context.settings.harmonics).select(static)
    slices = _slices_from_depth(gaussians, motion, context, limit)
    slices = slices or _repeated_slices(moving_rows, context.settings, limit)
    parts = [static_rows]
    for number, part in enumerate(slices):
        parts.append(part | _temporal_columns(motion, len(part["means"]), number, len(slices)))
    joined = {name: torch.cat([part[name] for part in parts]) for name in static_rows}
    moving_mask = torch.arange(len(joined["means"])) >= len(static)
    return FineStageInit(rows=joined, moving_mask=moving_mask)


def _slices_from_depth(
    static: Gaussians, motion: SpacetimeGaussians, context: InitContext, limit: int
) -> list[dict[str, Tensor]] | None:
    """Points from the depth of each slice; None if a slice has no depth."""
    count = context.settings.time_slices
    if not context.settings.use_depth:
        return None
    slices = []
    for number in range(count):
        center_s = motion.start_s + motion.duration_s * (number + 0.5) / count
        points = _unexplained_points(static, context, center_s, max(limit // count, 1))
        if points is None:
            return None
        slices.append(points)
    return slices


def _repeated_slices(
    moving_rows: dict[str, Tensor], settings: FitSettings, limit: int
) -> list[dict[str, Tensor]]:
    """The moving Gaussians per slice; a random subset in fewer slices if the limit is low."""
    total = len(moving_rows["means"])
    count = min(max(limit // total, 2), settings.time_slices)
    generator = torch.Generator().manual_seed(settings.seed)
    slices = []
    for _ in range(count):
        subset = torch.randperm(total, generator=generator)[: max(limit // count, 1)]
        slices.append({name: value[subset] for name, value in moving_rows.items()})
    return slices


def _temporal_columns(
    motion: SpacetimeGaussians, count: int, number: int, slices: int
) -> dict[str, Tensor]:
    """Time centres and deviations of the Gaussians of one slice."""
    center_s = motion.start_s + motion.duration_s * (number + 0.5) / slices
    deviation_s = SLICE_OVERLAP * motion.duration_s / slices
    return dict(motion.columns(count)) | {
        "time_centers_s": torch.full((count,), center_s),
        "log_deviations": torch.full((count,), math.log(deviation_s)),
    }


@torch.no_grad()
def _unexplained_points(
    static: Gaussians, context: InitContext, time_s: float, count: int
) -> dict[str, Tensor] | None:
    """Points on badly explained pixels of the frames nearest to ``time_s``; None without depth."""
    nearest_s = min(context.schedule.times_s, key=lambda other_s: abs(other_s - time_s))
    frames = context.schedule.frames_at[nearest_s]
    clouds = [_error_points(static, context, index) for index in frames]
    if any(cloud is None for cloud in clouds):
        return None
    positions = torch.cat([cloud.positions for cloud in clouds])
    if len(positions) == 0:
        return None
    generator = torch.Generator().manual_seed(context.settings.seed)
    subset = torch.randperm(len(positions), generator=generator)[:count]
    rgb = torch.cat([cloud.rgb for cloud in clouds])
    points = PointCloud(positions=positions[subset], rgb=rgb[subset])
    return params_from_points(points, context.settings.harmonics)


def _error_points(static: Gaussians, context: InitContext, index: int) -> PointCloud | None:
    """World points of the pixels of one frame with a large colour error."""
    frame, renderer = context.store.read(index), context.renderer
    if frame.depth is None:
        return None
    camera = renderer.camera(index, context.cameras)
    if renderer.traced:
        rgb = renderer.show_static(static, camera, index).rgb
    else:
        settings = RenderSettings(background=renderer.background)
        rgb = render(static, renderer.capture.cameras[index], settings=settings).rgb
    points, valid = unproject(camera, frame.depth)
    selected = ((rgb - frame.rgb).abs().mean(-1) > MIN_COLOR_ERROR) & valid
    if frame.counts is not None:
        selected = selected & frame.counts
    return PointCloud(positions=points[selected], rgb=frame.rgb[selected])
