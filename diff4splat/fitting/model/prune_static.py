"""Removes Gaussians from the motion that the fit found static; they keep their mean state.

Axes: ``n`` Gaussians, ``m`` moving Gaussians.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.model.canonical import params_from_gaussians
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.model.static_detection import confirm_static
from diff4splat.fitting.motions.static import NoMotion
from diff4splat.fitting.settings import FitSettings
from diff4splat.progress.skipped import SkippedWork
from diff4splat.render.physical.view_cone import radians_per_pixel

MAX_TIMES = 16


@torch.no_grad()
def prune_static(
    model: SceneModel, capture: Capture, settings: FitSettings, degree: int
) -> SkippedWork | None:
    """Stop the motion of every Gaussian within the tolerances; None if there is none.

    The displacement tolerance is ``offset_px`` pixels of the nearest training camera.
    """
    index = model.moving_index
    if len(index) == 0:
        return None
    canonical, motion = model.canonical(degree), model.motion(degree)
    moving = canonical.select(index)
    selected_motion = motion.select(model.moving_mask)
    times_s = torch.linspace(*capture.time_range_s, MAX_TIMES).tolist()
    limits = settings.stillness
    max_displacement = limits.offset_px * pixel_footprint(capture, moving.means)
    static, mean_state = confirm_static(
        lambda time_s: selected_motion.state_at(moving, time_s),
        times_s,
        (max_displacement, limits.change),
    )
    if not bool(static.any()):
        return None
    rows = params_from_gaussians(mean_state.select(static), settings.harmonics)
    higher = canonical.sh.shape[1] - 1
    rows["sh_rest"][:, higher:] = model.table["sh_rest"][index[static], higher:]
    model.table.rewrite(index[static], rows)
    model.moving_mask[index[static]] = False
    return SkippedWork(
        what="motion of static Gaussians",
        why=f"{int(static.sum()):,} of {len(index):,} moving Gaussians never moved further than "
        f"{limits.offset_px:g} px nor changed by more than {limits.change:g}",
        saved=f"{float(static.float().mean()):.0%} of all motion look-ups",
        error=limits.offset_px,
        error_unit="px",
    )


def pixel_footprint(capture: Capture, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    """Scene units per pixel at each point, in the nearest training camera."""
    training = capture.learnt
    cameras = capture.cameras[training].to(points.dtype)
    positions = cameras.position.unique(dim=0)
    distance = torch.cat([torch.cdist(part, positions).amin(1) for part in points.split(4096)])
    if capture.optics is None:
        return distance / float(cameras.focal_px.mean())
    return distance * radians_per_pixel(capture.cameras[int(training[0])], capture.optics)


def skipped_static_motion(model: SceneModel) -> SkippedWork | None:
    """The motion look-ups that static Gaussians save; None without motion or static Gaussians."""
    static = int((~model.moving_mask).sum())
    if isinstance(model.learned_motion, NoMotion) or static == 0:
        return None
    return SkippedWork(
        what="motion of static content",
        why=f"{static:,} of {len(model):,} Gaussians look the same at all times",
        saved=f"{static / len(model):.0%} of all motion look-ups and stored motion",
    )
