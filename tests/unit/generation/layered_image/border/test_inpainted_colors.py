"""Rings around a photograph take inpainted colours, and go on from one another."""

import pytest
import torch
from image_layers import input_image, layer, random_rgb
from torch import Tensor

from diff4splat.generation.layered_image.border.extension import extended_camera
from diff4splat.generation.layered_image.border.fine_border import (
    NEAR,
    PHOTOGRAPH,
    fine_border,
    fine_borders,
)
from diff4splat.generation.layered_image.border.inpainted_colors import inpaint_colors
from diff4splat.generation.layered_image.types import ImageLayer

SIZE_PX = (192, 320)


class Painter:
    """Paints grey, and keeps where colours were known."""

    def __init__(self) -> None:
        self.asked: list[tuple[Tensor, Tensor]] = []

    def __call__(self, rgb: Tensor, known: Tensor) -> Tensor:
        self.asked.append((rgb, known))
        return torch.where(known[..., None], rgb, 0.5)


def pixels(size_px: tuple[int, int] = SIZE_PX) -> ImageLayer:
    camera = input_image(torch.zeros(*size_px, 3), focal_px=300.0).camera
    return layer(torch.full(size_px, 4.0), camera=camera, rgb=random_rgb(*size_px))


def test_rings_take_what_is_inpainted() -> None:
    painter = Painter()
    near, far = fine_borders(pixels(), None, PHOTOGRAPH, painter)
    for ring in (near, far):
        torch.testing.assert_close(ring.rgb[ring.mask], torch.full_like(ring.rgb[ring.mask], 0.5))
    plain = fine_borders(pixels(), None, PHOTOGRAPH)
    for ring, other in zip((near, far), plain, strict=True):
        assert torch.equal(ring.depth, other.depth) and torch.equal(ring.mask, other.mask)


def test_the_farther_ring_knows_the_nearer_one() -> None:
    painter = Painter()
    far = fine_borders(pixels(), None, PHOTOGRAPH, painter)[1]
    (_, image), (colors, known) = painter.asked
    assert int(image.sum()) == 96 * 160
    # Its own cells are those that nobody knew before, but for the half cell at the seam.
    unknown = far.mask & known
    assert float(unknown.float().mean()) < 0.02
    assert bool((known | far.mask).all())
    ring = known & ~far.mask
    top, left = ((side - inner) // 2 for side, inner in zip(known.shape, (48, 80), strict=True))
    ring[top : top + 48, left : left + 80] = False
    torch.testing.assert_close(colors[ring], torch.full_like(colors[ring], 0.5), atol=0.3, rtol=0)


def test_small_images_keep_the_mean_of_their_border() -> None:
    painter = Painter()
    plain = fine_border(pixels(), None, NEAR)
    assert torch.equal(fine_border(pixels(), None, NEAR, inpaint=painter).rgb, plain.rgb)
    assert not painter.asked


@pytest.mark.parametrize("step", [1, 2, 4])
def test_colours_of_a_nearer_layer_keep_their_place(step: int) -> None:
    """A ramp over the nearer grid is the same ramp on another grid."""
    camera = input_image(torch.zeros(64, 64, 3), focal_px=80.0).camera
    grid = extended_camera(camera, 16, 1)
    across = (torch.arange(96) + 0.5 - grid.center_px[0]) / grid.focal_px[0]
    ramp = across[None, :, None].expand(96, 96, 3)
    nearer = layer(torch.ones(96, 96), camera=grid, rgb=ramp)
    coarse = extended_camera(camera, 32 // step, step)
    painter = Painter()
    inpaint_colors(torch.zeros(64 // step, 64 // step, 3), coarse, nearer, painter)
    colors, known = painter.asked[0]
    known = known.clone()
    known[:, 32 // step : 96 // step] = False  # The image itself, and what lies above and below.
    rays = (torch.arange(known.shape[1]) + 0.5 - coarse.center_px[0]) / coarse.focal_px[0]
    wanted = rays[None, :, None].expand(*known.shape, 3)
    assert int(known.sum()) == 2 * (16 // step) * (96 // step)
    torch.testing.assert_close(colors[known], wanted[known], atol=1e-4, rtol=0)
