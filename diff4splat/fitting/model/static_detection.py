"""Detects static Gaussians: from the errors of a static scene, and from the fitted motion.

Axes: ``n`` Gaussians, ``t`` times. A static scene explains static content equally well at all
times. Content that moves, or that a moving object occludes or shades, has a larger error at some
times than at others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.fitting.frames.frame_renderer import FrameRenderer, loss_mask
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.harmonics import dc_from_color

MIN_WEIGHT_PX = 1.0
"""Blending weight, summed over pixels, that a Gaussian needs at one time to get an error there."""
MAX_TIMES = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class _Blended:
    """One frame."""

    rgb: Float[Tensor, "h w 3"]
    features: Float[Tensor, "h w 2"]
    valid: Bool[Tensor, "h w"]


def error_variation(
    gaussians: Gaussians,
    renderer: FrameRenderer,
    store: FrameStore,
    schedule: FrameSchedule,
    cameras: CameraModel | None = None,
) -> Float[Tensor, " n"]:
    """Largest minus smallest mean colour error of each Gaussian's pixels over time."""
    at = torch.linspace(0, len(schedule.times_s) - 1, min(MAX_TIMES, len(schedule.times_s)))
    errors = []
    for number in at.round().long().unique().tolist():
        frames = schedule.frames_at[schedule.times_s[number]]
        errors.append(_errors(gaussians, renderer, store, frames, cameras))
    table = torch.stack(errors)
    largest = table.nan_to_num(nan=-torch.inf).amax(0)
    smallest = table.nan_to_num(nan=torch.inf).amin(0)
    return (largest - smallest).clamp_min(0)


def _errors(
    gaussians: Gaussians,
    renderer: FrameRenderer,
    store: FrameStore,
    frames: Sequence[int],
    cameras: CameraModel | None,
) -> Float[Tensor, " n"]:
    """Mean error at one time, weighted by blending weights; NaN for almost invisible Gaussians.

    The gradient of Σ_pixels w · f with respect to a blended feature f is Σ_pixels w · weight. With
    w the colour error it is the error that a Gaussian takes part in.
    """
    error_sum = gaussians.means.new_zeros(len(gaussians))
    weight_sum = torch.zeros_like(error_sum)
    for index in frames:
        frame = store.read(index)
        probe = gaussians.means.new_zeros(len(gaussians), 2).requires_grad_()
        if renderer.traced:
            blended = _blend_traced(gaussians, probe, renderer, index, cameras)
        else:
            blended = _blend_rasterized(gaussians, probe, renderer, index)
        mask = loss_mask(frame, blended.valid)
        error = (blended.rgb.detach() - frame.rgb).abs().mean(-1)
        ones = torch.ones_like(error)
        if mask is not None:
            error, ones = error * mask, ones * mask
        (blended.features * torch.stack([error, ones], -1)).sum().backward()
        error_sum += probe.grad[:, 0]
        weight_sum += probe.grad[:, 1]
    return torch.where(weight_sum >= MIN_WEIGHT_PX, error_sum / weight_sum, torch.nan)


def _blend_rasterized(
    gaussians: Gaussians, probe: Float[Tensor, "n 2"], renderer: FrameRenderer, index: int
) -> _Blended:
    settings = RenderSettings(features=probe, background=renderer.background)
    camera = renderer.capture.cameras[index]
    frame = render(gaussians, camera, outputs=("rgb", "features"), settings=settings)
    valid = torch.ones(frame.rgb.shape[:2], dtype=torch.bool)
    return _Blended(rgb=frame.rgb, features=frame.features, valid=valid)


def _blend_traced(
    gaussians: Gaussians,
    probe: Float[Tensor, "n 2"],
    renderer: FrameRenderer,
    index: int,
    cameras: CameraModel | None,
) -> _Blended:
    """Ray tracing blends colours only, so two colour channels carry the features.

    The features are added to mid grey, far from the clamp of colours.
    """
    camera = renderer.camera(index, cameras)
    with torch.no_grad():
        photo = renderer.show_static(gaussians, camera, index)
    colors = torch.nn.functional.pad(probe, (0, 1)) + 0.5
    probed = replace(gaussians, sh=dc_from_color(colors)[:, None])
    features = renderer.show_static(probed, camera, index).rgb[..., :2]
    return _Blended(rgb=photo.rgb, features=features, valid=photo.valid)


def confirm_static(
    state_at: Callable[[float], Gaussians],
    times_s: Sequence[float],
    tolerance: tuple[float | Float[Tensor, " n"], float],
) -> tuple[Bool[Tensor, " n"], Gaussians]:
    """The mask of Gaussians that stay within ``tolerance`` of their mean state, and that state.

    ``tolerance`` holds the largest displacement in scene units (one number, or one per Gaussian)
    and the largest change of opacity and colour. The mean state is the state at the time whose
    means are closest to the average over time.
    """
    states = [state_at(time_s) for time_s in times_s]
    means = torch.stack([state.means for state in states])
    mean_position = means.mean(0)
    displacement = (means - mean_position).norm(dim=-1).amax(0)
    opacities = torch.stack([state.opacities for state in states])
    colors = torch.stack([state.sh[:, 0] for state in states])
    change = (opacities.amax(0) - opacities.amin(0)).maximum(
        (colors.amax(0) - colors.amin(0)).amax(-1)
    )
    mean_state = states[int((means - mean_position).norm(dim=-1).mean(1).argmin())]
    return (displacement <= tolerance[0]) & (change <= tolerance[1]), mean_state
