"""A few steps of per-scene fits on tiny captures, then the fitted motion in float64."""

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import torch

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest, FitResult
from diff4splat.fitting.settings import FitSettings, MotionName, StaticDetectionSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.decoder import DecoderSize
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite, finite_gradients, relative_error
from diff4splat.stability.subjects.tiny_captures import tiny_captures

GROUP = "fits"
LIMIT = 1e-4
MOTIONS: dict[MotionName, str] = {"hexplane": "HexPlane", "spacetime": "native 4D"}
SETTINGS = FitSettings(
    coarse_steps=15,
    fine_steps=25,
    harmonics=1,
    harmonics_every=10,
    points=60,
    planes=HexPlaneSize(space=(8, 8, 8), time=4, channels=4, multipliers=(1,)),
    decoder=DecoderSize(width=16, heads=("position", "rotation", "scale", "opacity", "color")),
    time_slices=3,
    # Everything stays in the motion, or few steps would leave nothing to look at.
    stillness=StaticDetectionSettings(min_score=0.0, offset_px=0.0, change=0.0),
    checkpoint_every=1000,
    judge_every=1000,
)


def fit_checks() -> Iterator[Check]:
    """Each capture with each motion."""
    for motion, name in MOTIONS.items():
        for capture_name, build in tiny_captures().items():
            yield Check(
                group=GROUP,
                name=f"{name}, {capture_name}",
                run=partial(measure_fit, motion, build),
                limit=LIMIT,
                error_unit="relative, worst parameter at three times",
                quick=capture_name == "black images",
            )


def measure_fit(motion: MotionName, build: Callable[[], Capture]) -> Outcome:
    """Whether a fit ends with finite numbers, and the error of its states in float32."""
    settings = replace(SETTINGS, motion=motion)
    with tempfile.TemporaryDirectory() as folder:
        request = FitRequest(capture=build(), settings=settings, folder=Path(folder))
        result = fit_scene(request)
    states = [_states(result, time_s) for time_s in (0.0, 0.37, 1.0)]
    numbers = [value for got, _ in states for value in _values(got)]
    errors = [
        relative_error(part, want)
        for got, exact in states
        for part, want in zip(_values(got), _values(exact), strict=True)
    ]
    quality = [frame.psnr_db for frame in result.training]
    return Outcome(
        error=max(errors),
        value_finite=all_finite([*_values(result.gaussians), *numbers]),
        gradient_finite=_gradient_finite(result),
        note=f"{len(result.motion.moving_index)} of {len(result.gaussians)} Gaussians move; "
        f"training frames "
        f"{sum(quality) / max(len(quality), 1):.1f} dB",
    )


@torch.no_grad()
def _states(result: FitResult, time_s: float) -> tuple[Gaussians, Gaussians]:
    """In float32 and in float64."""
    wide = result.motion.to(torch.float64)
    return (
        result.motion.state_at(result.gaussians, time_s),
        wide.state_at(result.gaussians.to(torch.float64), time_s),
    )


def _gradient_finite(result: FitResult) -> bool | None:
    """Of all parameters at a time, in those of the canonical Gaussians."""
    canonical = result.gaussians
    leaves = {
        field.name: getattr(canonical, field.name).detach().clone().requires_grad_()
        for field in fields(canonical)
    }
    state = result.motion.state_at(replace(canonical, **leaves), 0.37)
    return finite_gradients(_values(state), leaves)


def _values(gaussians: Gaussians) -> list[torch.Tensor]:
    return [getattr(gaussians, field.name) for field in fields(gaussians)]
