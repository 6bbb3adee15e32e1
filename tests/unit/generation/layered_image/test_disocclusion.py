"""The layer behind what goes takes the colours of what stands around it."""

from dataclasses import replace

import torch
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.layered_image.disocclusion import (
    GROWN_PX,
    fill_from_neighbours,
    inpaint_disoccluded,
)
from diff4splat.generation.reconstruction import Canonical
from diff4splat.geometry.camera import pinhole, project
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.geometry.rays import world_rays
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.harmonics import color_from_dc, dc_from_color

SIDE = 24
PIXELS = SIDE * SIDE
GREEN, BLUE, RED = torch.eye(3)[[1, 2, 0]]


def picture() -> InputImage:
    """A blue thing in the middle of green."""
    rgb = GREEN.expand(SIDE, SIDE, 3).clone()
    rgb[thing()] = BLUE
    return InputImage(rgb=rgb, camera=pinhole(20.0, (SIDE, SIDE)), focal_source="test")


def thing() -> Tensor:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[8:16, 8:16] = True
    return mask


def layer(depth: float, color: Tensor) -> Gaussians:
    origins, directions = world_rays(picture().camera)
    away = distance_from_depth(picture().camera, torch.full((SIDE, SIDE), depth))
    return plain((origins + away[..., None] * directions).flatten(0, 1), color)


def plain(means: Tensor, color: Tensor) -> Gaussians:
    count = len(means)
    return Gaussians(
        means=means,
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).expand(count, 4),
        scales=torch.full((count, 3), 0.1),
        opacities=torch.full((count,), 0.9),
        sh=torch.cat([dc_from_color(color).expand(count, 1, 3), torch.full((count, 3, 3), 0.1)], 1),
    )


def canonical() -> Canonical:
    """Pixels, their backing, and a red layer behind both that reaches beyond the picture."""
    outside = torch.tensor([[9.0, 0.0, 6.0], [0.0, 0.0, -6.0], [0.0, 0.0, 0.0]])
    parts = [layer(4.0, RED), layer(4.2, RED), layer(6.0, RED), plain(outside, RED)]
    maps = RawGaussianMaps(
        gaussians=torch.zeros(1, 12, 1, SIDE, SIDE), tokens=torch.zeros(1, 1, 1, 1, 1)
    )
    cells = torch.arange(PIXELS)
    # All go with their pixel, but for those behind the last row.
    backing = torch.where(cells < PIXELS - SIDE, cells, PIXELS)
    return Canonical(gaussians=concatenate(parts), cells=cells, maps=maps, backing=backing)


def test_only_the_layer_behind_what_goes_changes_and_only_its_colour() -> None:
    before, after = (
        canonical().gaussians,
        inpaint_disoccluded(canonical(), thing(), picture()).gaussians,
    )
    for name in ("means", "quats", "scales", "opacities"):
        assert torch.equal(getattr(after, name), getattr(before, name)), name
    changed = (after.sh != before.sh).flatten(1).any(1)
    assert not changed[: 2 * PIXELS].any() and not changed[3 * PIXELS :].any()
    wanted = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    wanted[8 - GROWN_PX : 16 + GROWN_PX, 8 - GROWN_PX : 16 + GROWN_PX] = True
    assert torch.equal(changed[2 * PIXELS : 3 * PIXELS].view(SIDE, SIDE), wanted)
    colors = color_from_dc(after.sh[changed, 0])
    torch.testing.assert_close(colors, GREEN.expand(len(colors), 3), atol=1e-5, rtol=0)
    assert not after.sh[changed, 1:].any()
    assert bool((project(picture().camera, after.means[changed])[1] > 0).all())


def test_pixels_at_the_border_of_a_thing_lend_no_colour() -> None:
    mixed = picture().rgb
    mixed[6:18, 6:18] = 0.5 * (GREEN + BLUE)
    mixed[thing()] = BLUE
    before = canonical().gaussians
    after = inpaint_disoccluded(canonical(), thing(), replace(picture(), rgb=mixed)).gaussians
    changed = (after.sh != before.sh).flatten(1).any(1)
    colors = color_from_dc(after.sh[changed, 0])
    assert len(colors) >= 64
    torch.testing.assert_close(colors, GREEN.expand(len(colors), 3), atol=1e-5, rtol=0)


def test_backing_that_stands_changes_too() -> None:
    low = torch.zeros_like(thing())
    low[-4:, 8:16] = True
    changed = (
        inpaint_disoccluded(canonical(), low, picture()).gaussians.sh != canonical().gaussians.sh
    )
    backing = changed.flatten(1).any(1)[PIXELS : 2 * PIXELS].view(SIDE, SIDE)
    assert bool(backing[-1, 8 - GROWN_PX : 16 + GROWN_PX].all())
    assert int(backing.sum()) == 8 + 2 * GROWN_PX


def test_where_nothing_or_everything_goes_nothing_changes() -> None:
    for moving in (torch.zeros_like(thing()), torch.ones_like(thing())):
        scene = canonical()
        assert inpaint_disoccluded(scene, moving, picture()) is scene


def test_colours_come_from_as_near_as_there_are_any() -> None:
    rgb = torch.zeros(SIDE, SIDE, 3)
    rgb[:, : SIDE // 2], rgb[:, SIDE // 2 :] = GREEN, BLUE
    known = torch.ones(SIDE, SIDE, dtype=torch.bool)
    known[6:18, 1:5] = False
    found = fill_from_neighbours(rgb, known)
    assert torch.equal(found[known], rgb[known])
    torch.testing.assert_close(found, rgb)


def test_one_known_pixel_colours_all() -> None:
    known = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    known[3, 5] = True
    found = fill_from_neighbours(BLUE.expand(SIDE, SIDE, 3), known)
    torch.testing.assert_close(found, BLUE.expand(SIDE, SIDE, 3))
