"""What an image becomes: pixels and infill that it shows, and layers behind both."""

from typing import Any

import pytest
import torch
from image_layers import FAR_RANGES, input_image, is_finite, layer, random_depth, random_rgb
from torch import Tensor

from diff4splat.generation.inputs.input_image import downsample
from diff4splat.generation.layered_image import build
from diff4splat.generation.layered_image.build import (
    build_layered_image,
    farthest_depth,
)
from diff4splat.generation.layered_image.disoccluded import two_scales
from diff4splat.generation.layered_image.disoccluded.layer import disoccluded_layer
from diff4splat.generation.layered_image.disoccluded.occluded_layer import occluded_layers
from diff4splat.generation.layered_image.disoccluded.patch_texture import with_patch_texture
from diff4splat.generation.layered_image.disoccluded.sharp_colors import with_sharp_colors
from diff4splat.generation.layered_image.disoccluded.two_scales import agreeing_scales
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.gaussians import image_gaussians
from diff4splat.generation.layered_image.ground_colors import GROUND_SHARE, INPAINTED_SHARE
from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import (
    PIXEL_FOOTPRINT_PX,
    pixel_layer,
)
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer, LayeredImage
from diff4splat.generation.object_shadow.shadow import ObjectShadow
from diff4splat.models.ldrm.plane_prior import OPAQUE
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings

SIZE_PX, MARGIN, FACTOR = (16, 24), 2, 2
SMALL = (SIZE_PX[0] // FACTOR, SIZE_PX[1] // FACTOR)
TIMES_S = torch.linspace(0.0, 1.0, 5)


def built(
    displacement: Tensor | None = None,
    border_cells: int = MARGIN,
    limits: tuple[float, float] = (2.0, 9.0),
) -> LayeredImage:
    """An image of which networks see a quarter of the pixels."""
    image = input_image(random_rgb(*SIZE_PX))
    maps = ImageMaps(depth=random_depth(*SMALL, limits), displacement=displacement)
    return build_layered_image(downsample(image, FACTOR), image, maps, border_cells)


def with_box(border_cells: int = MARGIN, **changes: Any) -> LayeredImage:
    """The same with a box before a steep wall."""
    depth = torch.linspace(1.1, 4.0, SMALL[1]).exp().repeat(SMALL[0], 1)
    depth[2:6, 3:8] = 0.5
    image, box = random_rgb(*SIZE_PX), torch.zeros(SIZE_PX, dtype=torch.bool)
    box[4:12, 6:16] = True
    image = input_image(torch.where(box[..., None], image / 4, 0.75 + image / 4))
    maps = ImageMaps(depth=depth, displacement=changes.pop("displacement", None))
    return build_layered_image(downsample(image, FACTOR), image, maps, border_cells, **changes)


def test_steep_gaussians_lie_in_the_surface_of_all_layers_with_cells_of_a_pixel() -> None:
    layers = with_box().layers
    lattice = tuple(2 * side - 1 for side in SIZE_PX)
    fine = [tuple(layer.depth.shape) in (SIZE_PX, lattice) for layer in layers]
    assert [layer.in_surface for layer in layers] == fine
    assert {layer.in_image for layer in layers if layer.in_surface} == {True, False}


def moving_block() -> Tensor:
    """Four cells move to the right."""
    displacement = torch.zeros(3, *SMALL, 3)
    displacement[1:, 3:5, 4:6, 0] = torch.tensor([0.5, 1.0])[:, None, None]
    return displacement


def test_the_image_shows_pixels_and_infill_and_the_others_extend_it() -> None:
    pixels, infill, background, border, occluded, near, far = with_box().layers
    assert [layer.in_image for layer in with_box().layers] == [True, True, *[False] * 5]
    assert torch.equal(built().layers[0].rgb, random_rgb(*SIZE_PX))
    assert (pixels.opacity, pixels.footprint_px) == (OPAQUE, PIXEL_FOOTPRINT_PX)
    assert pixels.pixel_index.flatten().tolist() == list(range(16 * 24))
    assert infill.depth.shape == (31, 47)
    assert background.depth.shape == SMALL
    assert border.depth.shape == (2 + 2 * MARGIN, 3 + 2 * MARGIN)
    assert occluded.depth.shape == SIZE_PX
    assert near.depth.shape == (16 + 2 * 3, 24 + 2 * 3)
    assert far.depth.shape == (16 + 2 * 12, 24 + 2 * 12)
    assert built().visible_count == 31 * 47


def test_pixels_take_the_depth_of_the_larger_copy() -> None:
    image = input_image(random_rgb(2 * SIZE_PX[0], 2 * SIZE_PX[1]))
    small, larger = downsample(image, 4), downsample(image, 2)
    size_px = small.camera.size_px
    displacement = torch.zeros(2, *size_px, 3)
    displacement[1, ..., 0] = 0.5
    fine = FineMaps(rgb=larger.rgb, depth=torch.full(larger.camera.size_px, 7.0))
    maps = ImageMaps(depth=torch.full(size_px, 4.0), displacement=displacement, fine=fine)
    pixels = pixel_layer(small, image, maps)
    torch.testing.assert_close(pixels.depth, torch.full_like(pixels.depth, 7.0))
    # As far in the image as at the depth of the smaller copy.
    moved = pixels.displacement[1, ..., 0]
    torch.testing.assert_close(moved, torch.full_like(moved, 0.5 * 7 / 4))


def test_no_extended_layer_is_seen_before_farther_pixels_of_the_larger_copy() -> None:
    image = input_image(random_rgb(*SIZE_PX))
    fine = FineMaps(rgb=image.rgb, depth=torch.full(SIZE_PX, 7.0), smooth=False)
    maps = ImageMaps(depth=torch.full(SMALL, 4.0), displacement=None, fine=fine)
    layers = build_layered_image(downsample(image, FACTOR), image, maps, MARGIN).layers
    background, border = layers[2:4]
    assert background.depth.shape == SMALL and float(background.depth.min()) > 7.0
    inside = border.depth[MARGIN:-MARGIN, MARGIN:-MARGIN]
    assert inside.numel() and float(inside.min()) > 7.0


def test_the_farthest_pixel_decides() -> None:
    small, pixels = torch.tensor([[1.0, 5.0]]), torch.tensor([[2.0, 1.0, 3.0, 4.0]] * 2)
    assert farthest_depth(small, pixels).tolist() == [[2.0, 5.0]]


def test_images_that_networks_see_whole_have_no_occluded_layer() -> None:
    image = input_image(random_rgb(*SIZE_PX))
    depth = torch.full(SIZE_PX, 9.0)
    depth[4:12, 8:16] = 2.0
    assert occluded_layers(layer(depth, pixel_index=torch.zeros(SIZE_PX).long())).all
    maps = ImageMaps(depth=depth, displacement=None)
    assert len(build_layered_image(image, image, maps, MARGIN).layers) == 5


@pytest.mark.parametrize("side", [16, 8, 4])
def test_the_foreground_grows_by_a_pixel(side: int) -> None:
    image = input_image(torch.full((16, 16, 3), 0.5))
    depth = torch.full((side, side), 8.0)
    depth[:, : side // 2] = 2.0
    maps = ImageMaps(
        depth=torch.full((4, 4), 4.0),
        displacement=None,
        fine=FineMaps(rgb=downsample(image, 16 // side).rgb, depth=depth, smooth=False),
    )
    near = pixel_layer(downsample(image, 4), image, maps).depth < 3
    assert near.sum(1).tolist() == [9] * 16


def test_without_border_cells_there_is_no_border_layer() -> None:
    assert len(with_box(border_cells=0).layers) == 4


def test_coarse_layers_match_no_pixel_of_a_larger_image() -> None:
    gathered = image_gaussians(built(), TIMES_S)
    assert bool((gathered.pixel_index[16 * 24 :] == NO_PIXEL).all())
    image = input_image(random_rgb(*SIZE_PX))
    maps = ImageMaps(depth=torch.full(SIZE_PX, 4.0), displacement=None)
    background = build_layered_image(image, image, maps, MARGIN).layers[2]
    assert background.pixel_index.flatten().tolist() == list(range(16 * 24))


def test_beside_a_photograph_the_border_extension_lies_behind_its_rings() -> None:
    extension, *_, near, far = built(border_cells=3, limits=(4.0, 4.0)).layers[3:]
    assert float(extension.depth.min()) > max(float(near.depth.max()), float(far.depth.max()))
    image = input_image(random_rgb(*SIZE_PX))
    maps = ImageMaps(depth=torch.full(SIZE_PX, 4.0), displacement=None)
    extension, near = build_layered_image(image, image, maps, 4).layers[-2:]
    assert float(extension.depth.min()) < float(near.depth.min())


def test_from_the_input_camera_the_extended_layers_hide_nothing() -> None:
    image, camera = built(), input_image(random_rgb(*SIZE_PX)).camera
    gaussians = image_gaussians(image, TIMES_S).gaussians
    views = [
        render(each, camera, settings=RenderSettings(dilation_px2=0.0)).rgb
        for each in (gaussians, gaussians.select(slice(image.visible_count)))
    ]
    # Of noise, the worst case: cells beside the border are reflected noise, and shine into it.
    torch.testing.assert_close(views[0], views[1], atol=0.05, rtol=0)


def test_what_moves_takes_its_background_with_it_and_leaves_a_disoccluded_layer() -> None:
    wide = torch.zeros(3, *SMALL, 3)
    wide[1:, 1:4, 1:9, 0] = 0.5
    still, moving = built(limits=(4.0, 4.0)), built(wide, limits=(4.0, 4.0))
    block = wide.any(-1).any(0)
    assert bool(block[2::4, 2::4].any()), "some cells of the border extension are behind it"
    assert bool(moving.layers[0].displacement.any()) and bool(moving.layers[1].displacement.any())
    disoccluded, background, border, *fine = moving.layers[2:]
    shown = moving.layers[0].displacement.any(-1).any(0)
    assert disoccluded.displacement is None and bool(disoccluded.mask[shown].all())
    assert torch.equal(background.displacement, wide)
    assert torch.equal(background.rgb, still.layers[2].rgb), "all of it continues its pixel"
    assert torch.equal(background.mask, still.layers[2].mask)
    inner = slice(MARGIN, -MARGIN)
    assert torch.equal(border.mask[inner, inner], ~block[2::4, 2::4])
    area = torch.zeros(border.depth.shape, dtype=torch.bool)
    area[inner, inner] = grown(block)[2::4, 2::4]
    assert bool(area.any())
    assert torch.equal((border.rgb != still.layers[3].rgb).any(-1), area)
    assert all(each.displacement is None for each in (border, *fine)) and len(fine) == 2


def test_gaussians_of_displaced_layers_move_and_no_others() -> None:
    image = built(moving_block())
    gathered = image_gaussians(image, TIMES_S)
    moving = torch.zeros(len(gathered.gaussians), dtype=torch.bool)
    moving[gathered.motion.moving_index] = True
    border = sum(int(each.mask.sum()) for each in image.layers[-2:])
    assert bool(moving[: 16 * 24].any()) and not moving[-border:].any()


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("motion", ["nothing", "all", "some"])
def test_no_layer_ever_holds_nan(limits: tuple[float, float], motion: str) -> None:
    displacement = {
        "nothing": None,
        "all": torch.full((3, *SMALL, 3), 0.1),
        "some": moving_block(),
    }[motion]
    image = built(displacement, limits=limits)
    assert all(map(is_finite, image.layers))
    gathered = image_gaussians(image, TIMES_S)
    state = gathered.motion.state_at(gathered.gaussians, 0.6)
    for name in ("means", "scales", "quats", "opacities", "sh"):
        assert bool(getattr(state, name).isfinite().all()), name


def test_a_network_colours_every_layer_of_what_is_hidden_at_the_size_of_the_image() -> None:
    """And of the coarse layers the cells as far as the ground; all else is as without it."""

    def grey(rgb: Tensor, known: Tensor) -> Tensor:
        return torch.where(known[..., None], rgb, 0.5)

    moving = torch.zeros(3, *SMALL, 3)
    moving[1:, 3:5, 10:12, 0] = 0.5
    plain = with_box(displacement=moving).layers
    found = with_box(displacement=moving, inpaint=grey).layers
    changed = [not torch.equal(a.rgb, b.rgb) for a, b in zip(plain, found, strict=True)]
    assert changed == [False, False, *[True] * 6]
    for one, other in zip(plain, found, strict=True):
        assert torch.equal(one.depth, other.depth) and torch.equal(one.mask, other.mask)
    for hidden in found[5:]:
        assert bool((hidden.rgb[hidden.mask] == 0.5).all(-1).any())


def test_inpainted_ground_colours_cells_that_are_farther_before_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shares: list[float] = []

    def noted(
        layer: ImageLayer, pixels: ImageLayer, ground: ImageLayer, share: float
    ) -> ImageLayer:
        del pixels, ground
        shares.append(share)
        return layer

    monkeypatch.setattr(build, "with_ground_colors", noted)
    with_box()
    with_box(inpaint=lambda rgb, known: rgb)
    assert shares == [GROUND_SHARE, GROUND_SHARE, INPAINTED_SHARE, INPAINTED_SHARE]


def test_behind_what_moves_lie_the_texture_of_patches_and_sharp_colours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(two_scales, "COARSE_PX", 12)
    monkeypatch.setattr(two_scales, "LEAST_SIDE_PX", 24)

    def grey(rgb: Tensor, known: Tensor) -> Tensor:
        return torch.where(known[..., None], rgb, 0.5)

    moving = torch.zeros(3, *SMALL, 3)
    moving[1:, 3:5, 10:12, 0] = 0.5
    layers = with_box(displacement=moving, inpaint=grey).layers
    twice = agreeing_scales(grey)
    plain, textured = (
        disoccluded_layer(layers[0], each) for each in (twice, with_patch_texture(twice))
    )
    assert not torch.equal(plain.rgb, disoccluded_layer(layers[0], grey).rgb)
    expected = with_sharp_colors(textured).rgb
    assert torch.equal(layers[2].rgb, expected)
    assert not torch.equal(expected, textured.rgb) and not torch.equal(textured.rgb, plain.rgb)


@pytest.mark.parametrize("factor", [1, FACTOR])
def test_layers_are_lit_as_if_what_moves_cast_no_shadow(factor: int) -> None:
    image, height, width = input_image(0.2 + 0.3 * random_rgb(*SIZE_PX)), *SIZE_PX
    displacement = torch.zeros(3, height // factor, width // factor, 3)
    displacement[1:, 8 // factor : 12 // factor, 8 // factor : 12 // factor, 0] = 0.5
    maps = ImageMaps(
        depth=torch.full(displacement.shape[1:3], 3.0),
        displacement=displacement,
        shadows=(
            ObjectShadow(
                darkening=torch.full((height, width, 3), 0.4), displacement=torch.zeros(3, 3)
            ),
        ),
    )
    layered = build_layered_image(downsample(image, factor), image, maps, 0)
    pixels = layered.layers[0]
    moves = pixels.displacement.any(-1).any(0)
    assert bool(moves.any())
    torch.testing.assert_close(pixels.rgb[moves], image.rgb[moves])
    lit = image.rgb * torch.tensor(0.4).exp()
    torch.testing.assert_close(pixels.rgb[~moves], lit[~moves])
    # What the object hides is lit, too.
    behind = layered.layers[2]
    assert float(behind.rgb[behind.mask].mean()) > 0.85 * float(lit.mean())


def test_the_ground_lies_behind_what_moves() -> None:
    layered = with_box(displacement=moving_block())
    pixels = layered.layers[0]
    moves = pixels.displacement.any(-1).any(0)
    behind = layered.layers[2]
    assert torch.equal(layered.ground_depth[~moves], pixels.depth[~moves])
    covered = moves & behind.mask
    assert torch.equal(layered.ground_depth[covered], behind.depth[covered])
    assert bool((layered.ground_depth[covered] > pixels.depth[covered]).all())
    static = built()
    assert torch.equal(static.ground_depth, static.layers[0].depth)


def test_shadows_of_the_image_are_taken_off_a_copy_that_is_filled_by_video() -> None:
    image, small = input_image(random_rgb(32, 48)), (8, 12)
    maps = ImageMaps(
        depth=random_depth(*small, (2.0, 9.0)),
        displacement=None,
        fine=FineMaps(rgb=downsample(image, 2).rgb, depth=random_depth(16, 24, (2.0, 9.0))),
        shadows=(
            ObjectShadow(darkening=torch.full((32, 48, 3), 0.1), displacement=torch.zeros(2, 3)),
        ),
    )
    copy = downsample(image, 4)
    pixels = build_layered_image(copy, copy, maps, 0).layers[0]
    torch.testing.assert_close(pixels.rgb, (copy.rgb * torch.tensor(0.1).exp()).clamp(0, 1))
