"""A hidden layer shows the texture that it was given, not a blur of it."""

from dataclasses import replace

import pytest
import torch
from image_layers import box_mask, layer
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded.sharp_colors import with_sharp_colors
from diff4splat.generation.layered_image.disoccluded.static_layer import FOOTPRINT_PX
from diff4splat.generation.layered_image.gaussians import layer_gaussians
from diff4splat.generation.layered_image.types import ImageLayer
from diff4splat.render.api import UNDILATED, render

SIDE = 48


def _hidden(rgb: Tensor, depth: Tensor | None = None) -> ImageLayer:
    depth = torch.full((SIDE, SIDE), 5.0) if depth is None else depth
    return replace(layer(depth, rgb=rgb), mask=box_mask(), footprint_px=FOOTPRINT_PX)


def _error(found: ImageLayer, rgb: Tensor) -> float:
    seen = render(
        layer_gaussians(found), found.camera, outputs=("rgb", "alpha"), settings=UNDILATED
    )
    return float((seen.rgb / seen.alpha[..., None] - rgb)[box_mask()].square().mean().sqrt())


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_a_texture_keeps_its_contrast(slope: float) -> None:
    noise = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0))
    rgb, rows = 0.35 + 0.3 * noise, torch.arange(SIDE).float()[:, None]
    before = _hidden(rgb, (5.0 + slope * (SIDE - rows)).expand(SIDE, SIDE))
    after = with_sharp_colors(before)
    assert _error(after, rgb) < 0.4 * _error(before, rgb)


def test_only_colours_change_within_the_mask_and_stay_colours() -> None:
    noise = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0))
    before = _hidden(noise.round())
    after = with_sharp_colors(before)
    assert torch.equal(after.rgb[~box_mask()], before.rgb[~box_mask()])
    assert float(after.rgb.min()) >= 0 and float(after.rgb.max()) <= 1
    assert torch.equal(after.depth, before.depth) and torch.equal(after.mask, before.mask)


def test_even_colours_stay() -> None:
    before = _hidden(torch.full((SIDE, SIDE, 3), 0.4))
    after = with_sharp_colors(before)
    assert float((after.rgb - 0.4)[box_mask()].abs().max()) < 0.005


def test_an_empty_layer_stays() -> None:
    empty = replace(_hidden(torch.rand(SIDE, SIDE, 3)), mask=torch.zeros(SIDE, SIDE).bool())
    assert with_sharp_colors(empty) is empty
