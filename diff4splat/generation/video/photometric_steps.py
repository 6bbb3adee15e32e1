"""A reconstructed scene brought nearer to the frames of its video, by a few gradient steps.

LDRM predicts Gaussians once, and gives one object a copy per key frame where its depths disagree.
Rendering shows that. Adam (arXiv 1412.6980) lowers the squared error of all frames; what it changes
is in ``scene_change``. Motion stays as predicted.

Axes: ``f h w`` frames and pixels.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.optim import Adam
from torch.optim.lr_scheduler import LinearLR

from diff4splat.generation.video.scene_change import RATES, CellRays, changed, zero_change
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

CHANGED = ("means", "scales", "opacities", "sh")
"""What of the Gaussians depends on the change."""
LAST_RATE = 0.2
"""Share of the learning rates at the last step."""
BETAS = (0.8, 0.95)
"""Averages over fewer steps than usual: there are few."""
NO_EPS = 1e-15
"""Gradients of a mean over pixels are small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """A true video with its cameras and times."""

    rgb: Float[Tensor, "f h w 3"]
    path: CameraPath


def take_photometric_steps(
    scene: Scene, rays: CellRays, frames: Frames, steps: int, log: RunLog
) -> Scene:
    """The scene after ``steps`` gradient steps; the same scene if they do not lower the error.

    Also under ``no_grad``. ``frames.path`` is in the world frame of the scene.
    """
    if steps == 0:
        return scene
    with log.phases.phase("photometric steps", steps) as advance, torch.enable_grad():
        change = zero_change(scene.gaussians, rays)
        optimizer, decay = falling_adam(change, steps)
        for _ in range(steps):
            optimizer.zero_grad()
            add_gradients(scene, changed(scene.gaussians, change, rays), frames)
            optimizer.step()
            decay.step()
            advance()
    with torch.no_grad():
        new = replace(scene, gaussians=changed(scene.gaussians, change, rays))
        return better(scene, new, frames)


def add_gradients(scene: Scene, new: Gaussians, frames: Frames) -> None:
    """Gradients of the video's error with the Gaussians ``new``; one frame's graph at a time."""
    cut = {name: getattr(new, name).detach().requires_grad_() for name in CHANGED}
    shown = replace(scene, gaussians=replace(new, **cut))
    for index in range(len(frames.rgb)):
        frame_error(shown, frames, index).backward()
    torch.autograd.backward(
        [getattr(new, name) for name in CHANGED], [value.grad for value in cut.values()]
    )


def falling_adam(change: Mapping[str, Tensor], steps: int) -> tuple[Adam, LinearLR]:
    """Adam with the rates of ``scene_change``, and what lets them fall over ``steps``."""
    groups = [{"params": [value], "lr": RATES[name]} for name, value in change.items()]
    optimizer = Adam(groups, betas=BETAS, eps=NO_EPS)
    return optimizer, LinearLR(optimizer, 1.0, LAST_RATE, steps)


def better(before: Scene, after: Scene, frames: Frames) -> Scene:
    """The scene with the smaller error; ``before`` if a value of ``after`` is not finite."""
    values = (getattr(after.gaussians, field.name) for field in fields(after.gaussians))
    finite = all(bool(value.isfinite().all()) for value in values)
    if finite and video_error(after, frames) < video_error(before, frames):
        return after
    return before


def video_error(scene: Scene, frames: Frames) -> float:
    """Mean squared error of all frames."""
    return float(sum(frame_error(scene, frames, index) for index in range(len(frames.rgb))))


def frame_error(scene: Scene, frames: Frames, index: int) -> Float[Tensor, ""]:
    """What one frame adds to the mean squared error of the video."""
    camera, time_s = frames.path.cameras[index], float(frames.path.times_s[index])
    error = render(scene, camera, time_s).rgb - frames.rgb[index]
    return error.square().mean() / len(frames.rgb)
