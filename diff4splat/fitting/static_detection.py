"""Who has to move: found from the errors of a standing scene, and checked on the learned motion.

Axes: ``n`` Gaussians, ``t`` times. A scene that stands still explains a standing thing equally well
at all times. What moves, or is hidden, uncovered or shaded by what moves, has times at which the
pictures disagree more than at others.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.fitting.frame_renderer import Sight, counted
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.pictures import FrameStore, Schedule
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color

LEAST_WEIGHT = 1.0
"""Of a Gaussian in the pictures of one time, in pixels, to be judged there."""
MOST_TIMES = 32


def error_variation(
    gaussians: Gaussians,
    sight: Sight,
    store: FrameStore,
    schedule: Schedule,
    known: CameraModel | None = None,
) -> Float[Tensor, " n"]:
    """Mean colour error of each Gaussian's pixels at its worst time, less that at its best."""
    at = torch.linspace(0, len(schedule.times_s) - 1, min(MOST_TIMES, len(schedule.times_s)))
    errors = []
    for number in at.round().long().unique().tolist():
        frames = schedule.frames_at[schedule.times_s[number]]
        errors.append(_errors(gaussians, sight, store, frames, known))
    table = torch.stack(errors)
    worst = table.nan_to_num(nan=-torch.inf).amax(0)
    best = table.nan_to_num(nan=torch.inf).amin(0)
    return (worst - best).clamp_min(0)


def _errors(
    gaussians: Gaussians,
    sight: Sight,
    store: FrameStore,
    frames: Sequence[int],
    known: CameraModel | None,
) -> Float[Tensor, " n"]:
    """Weighted by how much each Gaussian shows in each pixel; NaN where it hardly shows.

    A blended feature f has the gradient Σ_pixels weight · w with respect to f, so that the gradient
    of Σ error · feature is the error that a Gaussian is part of.
    """
    error_sum = torch.zeros(len(gaussians))
    weight_sum = torch.zeros(len(gaussians))
    for index in frames:
        frame = store.read(index)
        probe = torch.zeros(len(gaussians), 2, requires_grad=True)
        blend = _photographed if sight.traced else _drawn
        rgb, blended, seen = blend(gaussians, probe, sight, index, known)
        counts = counted(frame, seen)
        error = (rgb.detach() - frame.rgb).abs().mean(-1)
        ones = torch.ones_like(error)
        if counts is not None:
            error, ones = error * counts, ones * counts
        (blended * torch.stack([error, ones], -1)).sum().backward()
        error_sum += probe.grad[:, 0]
        weight_sum += probe.grad[:, 1]
    return torch.where(weight_sum >= LEAST_WEIGHT, error_sum / weight_sum, torch.nan)


Blended = tuple[Float[Tensor, "h w 3"], Float[Tensor, "h w 2"], Bool[Tensor, "h w"]]
"""Colours, blended features, and where there is anything to be seen."""


def _drawn(
    gaussians: Gaussians,
    probe: Float[Tensor, "n 2"],
    sight: Sight,
    index: int,
    known: CameraModel | None,
) -> Blended:
    del known
    settings = RenderSettings(features=probe, background=sight.background)
    camera = sight.capture.cameras[index]
    made = render(gaussians, camera, outputs=("rgb", "features"), settings=settings)
    return made.rgb, made.features, torch.ones(made.rgb.shape[:2], dtype=torch.bool)


def _photographed(
    gaussians: Gaussians,
    probe: Float[Tensor, "n 2"],
    sight: Sight,
    index: int,
    known: CameraModel | None,
) -> Blended:
    """Rays blend colours only: two channels of a colour are the features.

    Grey in the middle is far from where colours are cut off.
    """
    camera = sight.camera(index, known)
    with torch.no_grad():
        shown = sight.standing(gaussians, camera, index)
    painted = torch.nn.functional.pad(probe, (0, 1)) + 0.5
    dyed = replace(gaussians, sh=dc_from_color(painted)[:, None])
    made = sight.standing(dyed, camera, index)
    return shown.rgb, made.rgb[..., :2], shown.valid


def proved_still(
    state_at: Callable[[float], Gaussians],
    times_s: Sequence[float],
    tolerance: tuple[float | Float[Tensor, " n"], float],
) -> tuple[Bool[Tensor, " n"], Gaussians]:
    """Who stays within ``tolerance`` of a mean state, and that state.

    ``tolerance`` is in scene units, for all or each, and for opacity and colour. The mean state is
    the one at the time whose means are nearest to their mean.
    """
    states = [state_at(time_s) for time_s in times_s]
    means = torch.stack([state.means for state in states])
    middle = means.mean(0)
    offset = (means - middle).norm(dim=-1).amax(0)
    opacities = torch.stack([state.opacities for state in states])
    colors = torch.stack([state.sh[:, 0] for state in states])
    change = (opacities.amax(0) - opacities.amin(0)).maximum(
        (colors.amax(0) - colors.amin(0)).amax(-1)
    )
    nearest = states[int((means - middle).norm(dim=-1).mean(1).argmin())]
    return (offset <= tolerance[0]) & (change <= tolerance[1]), nearest
