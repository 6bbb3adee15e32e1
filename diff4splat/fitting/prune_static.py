"""Gaussians that proved still leave the motion: they get their mean state and cost nothing then.

Axes: ``n`` Gaussians, ``m`` moving ones.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.canonical import raw_gaussians
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.motions.still import Still
from diff4splat.fitting.settings import FitSettings
from diff4splat.fitting.static_detection import proved_still
from diff4splat.progress.skipped import SkippedWork
from diff4splat.render.physical.view_cone import radians_per_pixel

MOST_TIMES = 16


@torch.no_grad()
def take_out_still(
    model: SceneModel, capture: Capture, settings: FitSettings, degree: int
) -> SkippedWork | None:
    """Stop the motion of every Gaussian that stays within the tolerances; None where none does.

    A Gaussian may go as far as ``offset_px`` in the nearest training camera.
    """
    index = model.moving_index
    if len(index) == 0:
        return None
    canonical, motion = model.canonical(degree), model.motion(degree)
    moving = canonical.select(index)
    alone = motion.select(model.moves)
    times_s = torch.linspace(*capture.time_range_s, MOST_TIMES).tolist()
    limits = settings.stillness
    reach = limits.offset_px * length_per_px(capture, moving.means)
    still, middle = proved_still(
        lambda time_s: alone.state_at(moving, time_s), times_s, (reach, limits.change)
    )
    if not bool(still.any()):
        return None
    rows = raw_gaussians(middle.select(still), settings.harmonics)
    higher = canonical.sh.shape[1] - 1
    rows["sh_rest"][:, higher:] = model.table["sh_rest"][index[still], higher:]
    model.table.rewrite(index[still], rows)
    model.moves[index[still]] = False
    return SkippedWork(
        what="motion of standing Gaussians",
        why=f"{int(still.sum()):,} of {len(index):,} moving Gaussians never went further than "
        f"{limits.offset_px:g} px nor changed by more than {limits.change:g}",
        saved=f"{float(still.float().mean()):.0%} of all motion look-ups",
        error=limits.offset_px,
    )


def length_per_px(capture: Capture, points: Float[Tensor, "n 3"]) -> Float[Tensor, " n"]:
    """Scene units that one pixel covers at each point, in the nearest training camera."""
    learnt = capture.learnt
    cameras = capture.cameras[learnt].to(points.dtype)
    places = cameras.position.unique(dim=0)
    distance = torch.cat([torch.cdist(part, places).amin(1) for part in points.split(4096)])
    if capture.optics is None:
        return distance / float(cameras.focal_px.mean())
    return distance * radians_per_pixel(capture.cameras[int(learnt[0])], capture.optics)


def left_standing(model: SceneModel) -> SkippedWork | None:
    """What the motion does not carry; None where it carries all, or there is none."""
    still = int((~model.moves).sum())
    if isinstance(model.learned, Still) or still == 0:
        return None
    return SkippedWork(
        what="motion of what stands",
        why=f"{still:,} of {len(model):,} Gaussians look the same at all times",
        saved=f"{still / len(model):.0%} of all motion look-ups and stored motion",
    )
