"""A few steps of per-scene fits on tiny captures; then their motion, and whole fits, in float64."""

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import torch

from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest, FitResult
from diff4splat.fitting.settings import (
    DtypeName,
    FitSettings,
    MotionName,
    StaticDetectionSettings,
)
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.decoder import DecoderSize
from diff4splat.scene.motion.hexplane.planes import HexPlaneSize
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite, finite_gradients, relative_error
from diff4splat.stability.subjects.tiny_captures import tiny_captures

GROUP = "fits"
LIMIT, PRECISION_LIMIT = 1e-4, 1e-3
FLOAT64_FITS = ("moving balls", "noise")
"""Captures that are also fitted in float64 from the first step."""
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
    """Each capture with each motion, and some in both precisions."""
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
        for capture_name in FLOAT64_FITS:
            yield Check(
                group=GROUP,
                name=f"{name}, {capture_name}, whole fit",
                run=partial(measure_precision, motion, tiny_captures()[capture_name]),
                limit=PRECISION_LIMIT,
                error_unit="root mean square of frames, fit in float32 against fit in float64",
            )


def measure_fit(motion: MotionName, build: Callable[[], Capture]) -> Outcome:
    """Whether a fit ends with finite numbers, and the error of its states in float32."""
    result = _fitted(motion, build(), "float32")
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


def measure_precision(motion: MotionName, build: Callable[[], Capture]) -> Outcome:
    """How far rounding takes a whole fit: frames of the fits in float32 and in float64."""
    capture = build()
    usual, exact = (_fitted(motion, capture, dtype) for dtype in ("float32", "float64"))
    errors = [
        (one.double() - other).square().mean()
        for one, other in zip(_frames(usual, capture), _frames(exact, capture), strict=True)
    ]
    numbers = [*_values(usual.gaussians), *_values(exact.gaussians)]
    return Outcome(error=float(torch.stack(errors).mean().sqrt()), value_finite=all_finite(numbers))


def _fitted(motion: MotionName, capture: Capture, dtype: DtypeName) -> FitResult:
    settings = replace(SETTINGS, motion=motion, dtype=dtype)
    with tempfile.TemporaryDirectory() as folder:
        return fit_scene(FitRequest(capture=capture, settings=settings, folder=Path(folder)))


@torch.no_grad()
def _frames(result: FitResult, capture: Capture) -> list[torch.Tensor]:
    times_s = capture.times_s.tolist()
    states = [result.motion.state_at(result.gaussians, time_s) for time_s in times_s]
    return [
        result.renderer.rasterize(state, index).rgb.clamp(0, 1)
        for index, state in enumerate(states)
    ]


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
