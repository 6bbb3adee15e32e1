"""Seconds of both tracers on one scene, in turns, so that what disturbs one disturbs the other."""

import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from statistics import median

import torch
from torch import Tensor

from benchmarks.tracing import mitsuba_tracer as mitsuba
from benchmarks.tracing.scenes import RULES, Scene
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians

Task = Callable[[], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """Medians over the repeats; ours always builds its search tree."""

    scene: str
    rays: int
    ours_s: float
    ours_both_s: float
    """Forward and backward."""
    mitsuba_s: float
    """Search structure built before."""
    mitsuba_built_s: float
    """Search structure built in the time."""
    mitsuba_both_s: float
    mitsuba_both_built_s: float
    least_ratio: float
    """Of forward without building, over the repeats."""
    least_both_ratio: float
    agree_share: float
    """Rays whose colours differ by no more than 1e-5."""
    close_share: float
    """By no more than 1e-2."""
    mean_difference: float
    gradient_cosine: float
    """Of the gradients in all means."""


def measure(scene: Scene, repeats: int) -> Row:
    """Everything of one scene; first calls, which compile, are not counted."""
    gaussians, rays = scene.build()
    tasks = _tasks(gaussians, rays)
    answers = {name: task() for name, task in tasks.items()}
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for turn in range(repeats):
        order = list(tasks)[turn % len(tasks) :] + list(tasks)[: turn % len(tasks)]
        for name in order:
            began = time.perf_counter()
            tasks[name]()
            seconds[name].append(time.perf_counter() - began)
    difference = (answers["ours_s"] - answers["mitsuba_s"]).abs().amax(1)
    return Row(
        scene=scene.name,
        rays=len(rays),
        **{name: median(values) for name, values in seconds.items()},
        least_ratio=_least(seconds["mitsuba_s"], seconds["ours_s"]),
        least_both_ratio=_least(seconds["mitsuba_both_s"], seconds["ours_both_s"]),
        agree_share=float((difference <= 1e-5).double().mean()),
        close_share=float((difference <= 1e-2).double().mean()),
        mean_difference=float(difference.double().mean()),
        gradient_cosine=_cosine(answers["ours_both_s"][0], answers["mitsuba_both_s"][0]),
    )


def _least(theirs: list[float], ours: list[float]) -> float:
    """The worst turn for us."""
    return min(a / b for a, b in zip(theirs, ours, strict=True))


def _cosine(means: Tensor, table: Tensor) -> float:
    """``table`` has (centre, scale, quaternion) of one Gaussian after another."""
    theirs = table.view(-1, 10)[:, :3].flatten().double()
    return float(torch.nn.functional.cosine_similarity(means.flatten().double(), theirs, dim=0))


def _tasks(gaussians: Gaussians, rays: Rays) -> dict[str, Task]:
    weight = torch.rand(len(rays), 3, generator=torch.Generator().manual_seed(1))
    loaded, lines = mitsuba.load(gaussians), mitsuba.to_rays(rays)
    return {
        "ours_s": lambda: _ours(gaussians, rays),
        "mitsuba_s": lambda: mitsuba.forward(loaded, lines),
        "mitsuba_built_s": lambda: mitsuba.forward(mitsuba.load(gaussians), lines),
        "ours_both_s": lambda: _ours_both(gaussians, rays, weight),
        "mitsuba_both_s": lambda: mitsuba.forward_backward(loaded, lines, weight),
        "mitsuba_both_built_s": lambda: mitsuba.forward_backward(
            mitsuba.load(gaussians), lines, weight
        ),
    }


def _ours(gaussians: Gaussians, rays: Rays) -> Tensor:
    with torch.no_grad():
        return trace(gaussians, rays, settings=RULES, backend="compiled").rgb


def _ours_both(gaussians: Gaussians, rays: Rays, weight: Tensor) -> list[Tensor]:
    names = [field.name for field in fields(gaussians)]
    leaves = [getattr(gaussians, name).detach().requires_grad_() for name in names]
    watched = replace(gaussians, **dict(zip(names, leaves, strict=True)))
    rgb = trace(watched, rays, settings=RULES, backend="compiled").rgb
    return list(torch.autograd.grad((rgb * weight).sum(), leaves))
