"""Degenerate Gaussians: sizes, opacities, rotations, places."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from diff4splat.scene.gaussians import Gaussians
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.subjects.cloud import COUNT, DISTANCE, camera, cloud
from diff4splat.stability.subjects.rendered import (
    RENDER_LIMIT,
    TRACE_LIMIT,
    measure_render,
    measure_trace,
)

GROUP = "gaussians"
SCALES = (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e3)
QUICK = ("zero quaternions", "opacity 1", "on the camera plane")


def gaussian_checks() -> Iterator[Check]:
    """Each case by the rasteriser and by the ray tracer."""
    for name, build in cases().items():
        for backend, measure, limit in (
            ("rasterised", measure_render, RENDER_LIMIT),
            ("ray traced", measure_trace, TRACE_LIMIT),
        ):
            yield Check(
                group=GROUP,
                name=f"{name}, {backend}",
                run=partial(_measure, build, measure),
                limit=limit,
                error_unit="RMS of RGB",
                quick=name in QUICK,
            )


def cases() -> Mapping[str, Callable[[], Gaussians]]:
    """Name → Gaussians in view of the camera at the origin."""
    sizes = {f"all scales {scale:g}": partial(_scaled, scale) for scale in SCALES}
    return sizes | {
        "scales 1e-6 to 1e3 in one Gaussian": _needles,
        "opacity 0": lambda: replace(cloud(), opacities=torch.zeros(COUNT)),
        "opacity 1": lambda: replace(cloud(), opacities=torch.ones(COUNT)),
        "zero quaternions": lambda: replace(cloud(), quats=torch.zeros(COUNT, 4)),
        "coplanar": lambda: _moved(lambda means: means * _row(1, 1, 0) + _row(0, 0, DISTANCE)),
        "collinear": lambda: _moved(lambda means: means * _row(1, 0, 0) + _row(0, 0, DISTANCE)),
        "coincident": lambda: _moved(lambda means: 0 * means + _row(0.1, 0.1, DISTANCE)),
        "some at an offset of 1e6": lambda: _moved(_offset),
        "on the camera plane": lambda: _moved(lambda means: means * _row(1, 1, 0)),
        "around the camera": lambda: _moved(lambda means: means - _row(0, 0, DISTANCE)),
        "on the camera centre": lambda: _moved(torch.zeros_like),
        "none": lambda: cloud().select(slice(0)),
    }


def _measure(build: Callable[[], Gaussians], measure: Callable[..., Outcome]) -> Outcome:
    return measure(build(), camera())


def _scaled(scale: float) -> Gaussians:
    gaussians = cloud()
    return replace(gaussians, scales=torch.full_like(gaussians.scales, scale))


def _needles() -> Gaussians:
    """One axis of each is a millionth of a unit long and another one a thousand units."""
    gaussians = cloud()
    return replace(gaussians, scales=torch.tensor([1e-6, 1e-2, 1e3]).expand(len(gaussians), 3))


def _moved(move: Callable[[Tensor], Tensor]) -> Gaussians:
    gaussians = cloud()
    return replace(gaussians, means=move(gaussians.means))


def _offset(means: Tensor) -> Tensor:
    """Every second Gaussian is far away, in a direction of its own."""
    directions = torch.nn.functional.normalize(means - _row(0, 0, DISTANCE), dim=1)
    far = torch.arange(len(means)) % 2 == 1
    return torch.where(far[:, None], means + 1e6 * directions, means)


def _row(x: float, y: float, z: float) -> Tensor:
    return torch.tensor([[x, y, z]])
