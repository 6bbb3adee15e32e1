"""Shadows as Gaussians: the first view is the image, later ones are lit where the shadow was."""

from dataclasses import replace

import pytest
import torch

from diff4splat.generation.layered_image.gaussians import GONE, image_gaussians
from diff4splat.generation.layered_image.types import ImageLayer, LayeredImage
from diff4splat.generation.object_shadow.gaussians import (
    shadow_gaussians,
    veil,
    with_shadows,
)
from diff4splat.generation.object_shadow.shadow import ObjectShadow
from diff4splat.geometry.camera import pinhole
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

SIDE, FOCAL = 48, 60.0
TIMES = torch.tensor([0.0, 0.5, 1.0])
LIT = torch.tensor([0.6, 0.5, 0.4])
DARK = torch.tensor([0.9, 0.8, 0.6])


def layered(moving: bool = True) -> LayeredImage:
    """A wall of one colour at depth 2, a moving patch on its left."""
    displacement = torch.zeros(2, SIDE, SIDE, 3)
    if moving:
        displacement[1, 16:32, 2:8, 0] = 0.8
    pixels = ImageLayer(
        camera=pinhole(FOCAL, (SIDE, SIDE)),
        rgb=LIT.expand(SIDE, SIDE, 3).clone(),
        depth=torch.full((SIDE, SIDE), 2.0),
        mask=torch.ones(SIDE, SIDE, dtype=torch.bool),
        opacity=0.999,
        footprint_px=0.6,
        displacement=displacement,
        in_image=True,
    )
    return LayeredImage(layers=(pixels,), ground_depth=pixels.depth)


def shadow(columns: slice = slice(8, 20)) -> ObjectShadow:
    darkening = torch.zeros(SIDE, SIDE, 3)
    darkening[16:32, columns] = DARK
    return ObjectShadow(
        darkening=darkening, displacement=torch.tensor([[0.0, 0.0, 0.0], [0.8, 0.0, 0.0]])
    )


def views(found) -> list[torch.Tensor]:
    camera, settings = layered().layers[0].camera, RenderSettings(dilation_px2=0.0)
    states = [found.motion.state_at(found.gaussians, time) for time in (0.0, 1.0)]
    return [render(state, camera, settings=settings).rgb for state in states]


def test_a_veil_darkens_as_it_is_told() -> None:
    lit, darkening = torch.rand(200, 3), 2 * torch.rand(200, 3)
    through, rgb = veil(lit, darkening)
    darkened = through[:, None] * lit + (1 - through[:, None]) * rgb
    assert torch.allclose(darkened, lit * (-darkening).exp(), atol=1e-6)
    assert bool(((rgb >= 0) & (rgb <= 1)).all())
    # No more light than needed: some channel of each colour is black.
    assert float(rgb.amin(-1).max()) < 1e-6


@pytest.mark.parametrize("darkening", [0.0, 1e-6, 30.0])
def test_extreme_veils_are_finite(darkening: float) -> None:
    through, rgb = veil(torch.tensor([[0.0, 1.0, 0.5]]), torch.full((1, 3), darkening))
    assert bool(through.isfinite().all()) and bool(rgb.isfinite().all())


def test_the_shadow_is_where_it_was_and_goes_along() -> None:
    image = layered()
    found = with_shadows(image_gaussians(image, TIMES), image, [shadow()], TIMES)
    first, last = views(found)
    dark = LIT * (-DARK).exp()
    inside, shift = (slice(20, 28), slice(11, 17)), 24
    assert torch.allclose(first[inside], dark.expand_as(first[inside]), atol=0.03)
    assert torch.allclose(last[inside], LIT.expand_as(last[inside]), atol=0.01)
    moved = last[inside[0], slice(inside[1].start + shift, inside[1].stop + shift)]
    assert torch.allclose(moved, dark.expand_as(moved), atol=0.03)
    beside = first[2:12, 30:44]
    assert torch.allclose(beside, LIT.expand_as(beside), atol=0.01)


def test_what_moves_has_no_shadow_of_its_own() -> None:
    image = layered()
    plain = image_gaussians(image, TIMES)
    assert with_shadows(plain, image, [shadow(slice(2, 8))], TIMES) is plain
    assert with_shadows(plain, image, [], TIMES) is plain


def test_it_vanishes_where_the_ground_ends() -> None:
    image = layered()
    ground = image.ground_depth.clone()
    ground[:, 28:] = 9.0
    image = replace(image, ground_depth=ground)
    one = shadow()
    chosen = one.darkening.any(-1)
    growth = shadow_gaussians(image, one, chosen, TIMES).motion.log_scale_offsets
    assert torch.all(growth[0] == 0)
    assert torch.all(growth[-1] == GONE)


def test_the_layers_that_the_image_shows_have_the_same_shadows() -> None:
    image = layered()
    alone = shadow_gaussians(image.visible, shadow(), shadow().darkening.any(-1), TIMES)
    whole = shadow_gaussians(image, shadow(), shadow().darkening.any(-1), TIMES)
    assert torch.equal(alone.motion.offsets, whole.motion.offsets)
