"""Work of ``diff4splat fit``, counted from its settings and from the capture before the first step.

Gaussians grow by splits, at most to the budget; the counts here are the most that they can be.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import read_scene_header

if TYPE_CHECKING:
    from diff4splat.cli.fit import Fit
    from diff4splat.data.capture.capture import Capture
    from diff4splat.fitting.settings import DensitySettings, FitSettings

NAME = "fit"
MOVING_SHARE = 0.13
"""Of the Gaussians: the mean of the fits in docs/results/fitting.md. Which ones move is known after
the coarse stage alone."""
RGB_BYTES, DEPTH_BYTES = 12, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """Gaussians of a stage."""

    summed: float | int
    """Over the steps."""
    last: float | int


def work(
    settings: "FitSettings", capture: "Capture", first_gaussians: float | int, coarse_steps: int
) -> dict[str, float | int]:
    """Counted work of a fit that starts with ``first_gaussians``."""
    static = settings.motion == "static"
    fine_steps = 0 if static else settings.fine_steps
    coarse = grow(first_gaussians, coarse_steps + settings.fine_steps * static, settings.density)
    fine = grow(coarse.last, fine_steps, settings.density)
    steps = coarse_steps + settings.fine_steps
    views = min(settings.views_per_step, len(capture.camera_index.unique()))
    height, width = capture.cameras.size_px
    pixels, share = height * width, 1.0 if settings.stillness.min_score <= 0 else MOVING_SHARE
    return {
        "start": 1,
        f"stage {settings.motion}": 0 if static else 1,
        **({} if static else {f"fit_steps {settings.motion}": fine_steps}),
        "fit_steps static": steps - fine_steps,
        "fitted_gaussians": views * (coarse.summed + fine.summed),
        f"moved_gaussians {settings.motion}": 0 if static else share * fine.summed,
        "fitted_pixels": pixels * views * steps,
        "held_gaussians": fine.last,
        "cached_bytes": cached_bytes(settings, capture),
    }


def grow(first: float | int, steps: int, density: "DensitySettings") -> Growth:
    """Gaussians at each step, if every splitting step splits as many as it may."""
    from diff4splat.fitting.stage_loop import FIRST_SPLIT_STEP

    count, summed, since = float(first), 0.0, 0
    for step in range(density.every, steps + 1, density.every):
        if step >= FIRST_SPLIT_STEP and step <= density.until * steps:
            summed, since = summed + count * (step - since), step
            count = max(count, min(density.budget, count * (1 + density.growth) + 1))
    return Growth(summed=summed + count * (steps - since), last=count)


def first_gaussians(settings: "FitSettings", capture: "Capture") -> int:
    """Points that a fit starts from: given, of depth maps, or random ones."""
    from diff4splat.fitting.model.initial_points import SHELL_SHARE

    count = min(settings.points, settings.density.budget)
    shell = 0 if capture.background is not None else int(SHELL_SHARE * count)
    inner = count - shell
    if capture.points is not None:
        inner = min(inner, len(capture.points.positions))
    elif settings.use_depth:
        inner = min(inner, _depth_points(capture) or inner)
    return inner + shell


def cached_bytes(settings: "FitSettings", capture: "Capture") -> float | int:
    """Images that a fit keeps."""
    height, width = capture.cameras.size_px
    per_pixel = RGB_BYTES + DEPTH_BYTES * settings.use_depth
    return min(height * width * len(capture) * per_pixel, settings.picture_memory_mb << 20)


def request_work(command: "Fit") -> dict[str, float | int]:
    """The same from the options; poses and the first depth map of the capture are read."""
    return capture_work(command, command.settings(), command.capture())


def capture_work(
    command: "Fit", settings: "FitSettings", capture: "Capture"
) -> dict[str, float | int]:
    """The same of a capture that has been read."""
    if command.init is not None:
        return work(settings, capture, read_scene_header(command.init).gaussians, 0)
    return work(settings, capture, first_gaussians(settings, capture), settings.coarse_steps)


def promise(command: "Fit", settings: "FitSettings", capture: "Capture") -> Promise | None:
    """What a fit from its start is expected to need; None for a motion that was not measured."""
    return Costing.of().plain_promise(NAME, capture_work(command, settings, capture))


def _depth_points(capture: "Capture") -> int:
    """Pixels with depth in the frames nearest to the middle of the time; 0 without depth."""
    learnt = capture.learnt
    gap_s = (capture.times_s[learnt] - sum(capture.time_range_s) / 2).abs()
    nearest = learnt[gap_s <= gap_s.min() * (1 + 1e-6) + 1e-12]
    depth = capture.frames.read(int(nearest[0])).depth if len(nearest) else None
    return 0 if depth is None else int((depth > 0).sum()) * len(nearest)
