"""Any numbers at all: images and gradients are finite, or the numbers are refused by name."""

from collections import Counter

import pytest
import torch
from extreme_scenes import ExtremeNumbers, gradients, not_finite

from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera
from diff4splat.render.api import render
from diff4splat.render.settings import OUTPUTS, RenderSettings
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians

TRACED = ("rgb", "distance", "alpha")


def rasterized(seed: int) -> list[str]:
    """What is not finite of one scene."""
    numbers = ExtremeNumbers(seed)
    leaves, lens = numbers.gaussians(), numbers.camera()
    camera = Camera(**lens, size_px=(12, 14))
    features = torch.linspace(-1, 1, 2 * len(leaves["means"])).view(-1, 2).requires_grad_()
    settings = RenderSettings(features=features, flow_camera=camera)
    image = render(
        Gaussians(**leaves), camera, outputs=OUTPUTS, settings=settings, backend="raster"
    )
    values = {name: getattr(image, name) for name in OUTPUTS}
    sum(value.mean() for value in values.values()).backward()
    return not_finite(values | gradients(leaves, lens, {"features": features}))


def traced(seed: int) -> list[str]:
    """The same of rays through a scene."""
    numbers = ExtremeNumbers(seed)
    leaves, lines = numbers.gaussians(), numbers.rays()
    answer = trace(Gaussians(**leaves), Rays(**lines), outputs=TRACED)
    values = {name: getattr(answer, name) for name in TRACED}
    sum(value.mean() for value in values.values()).backward()
    return not_finite(values | gradients(leaves, lines))


def found(draw, seeds: range) -> tuple[dict[int, list[str]], Counter]:
    """Seeds with something that is not finite, and how many were drawn and refused."""
    bad, counts = {}, Counter()
    for seed in seeds:
        try:
            wrong = draw(seed)
        except InputError:
            counts["refused"] += 1
            continue
        counts["drawn"] += 1
        if wrong:
            bad[seed] = wrong
    return bad, counts


@pytest.mark.parametrize("draw", [rasterized, traced])
def test_some_scenes(draw) -> None:
    bad, counts = found(draw, range(200))
    assert not bad
    assert counts["drawn"] > 150


@pytest.mark.slow
@pytest.mark.parametrize(("draw", "count"), [(rasterized, 10_000), (traced, 4_000)])
def test_many_scenes(draw, count: int) -> None:
    bad, _ = found(draw, range(200, 200 + count))
    assert not bad
