"""Who has to move: found from the errors of a standing scene, and checked on the learned motion.

Axes: ``n`` Gaussians, ``t`` times. A scene that stands still explains a standing thing equally well
at all times. What moves, or is hidden, uncovered or shaded by what moves, has times at which the
pictures disagree more than at others.
"""

from collections.abc import Callable, Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.training.per_scene.pictures import FrameStore, Schedule

LEAST_WEIGHT = 1.0
"""Of a Gaussian in the pictures of one time, in pixels, to be judged there."""
MOST_TIMES = 32


def error_variation(
    gaussians: Gaussians, capture: Capture, store: FrameStore, schedule: Schedule
) -> Float[Tensor, " n"]:
    """Mean colour error of each Gaussian's pixels at its worst time, less that at its best."""
    at = torch.linspace(0, len(schedule.times_s) - 1, min(MOST_TIMES, len(schedule.times_s)))
    errors = []
    for number in at.round().long().unique().tolist():
        frames = schedule.frames_at[schedule.times_s[number]]
        errors.append(_errors(gaussians, capture, store, frames))
    table = torch.stack(errors)
    worst = table.nan_to_num(nan=-torch.inf).amax(0)
    best = table.nan_to_num(nan=torch.inf).amin(0)
    return (worst - best).clamp_min(0)


def _errors(
    gaussians: Gaussians, capture: Capture, store: FrameStore, frames: Sequence[int]
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
        settings = RenderSettings(features=probe, background=capture.background or (0.0, 0.0, 0.0))
        made = render(
            gaussians, capture.cameras[index], outputs=("rgb", "features"), settings=settings
        )
        error = (made.rgb.detach() - frame.rgb).abs().mean(-1)
        ones = torch.ones_like(error)
        if frame.counts is not None:
            error, ones = error * frame.counts, ones * frame.counts
        (made.features * torch.stack([error, ones], -1)).sum().backward()
        error_sum += probe.grad[:, 0]
        weight_sum += probe.grad[:, 1]
    return torch.where(weight_sum >= LEAST_WEIGHT, error_sum / weight_sum, torch.nan)


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
