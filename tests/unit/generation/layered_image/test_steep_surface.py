"""Gaussians of steep surfaces: in the surface, the same for the input view, without gaps beside."""

import math
from dataclasses import replace

import pytest
import torch
from image_layers import FAR_RANGES, input_image, layer, layered, random_depth, random_rgb
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import image_gaussians, layer_gaussians
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.pixel_maps.pixel_layer import pixel_layer
from diff4splat.generation.layered_image.steep_surface import LEAST_SLOPE, in_steep_surface
from diff4splat.generation.layered_image.subpixel_infill import subpixel_infill
from diff4splat.generation.layered_image.types import DEPTH_STEP, ImageLayer
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import world_rays
from diff4splat.geometry.rigid import look_at
from diff4splat.render.api import UNDILATED, render
from diff4splat.scene.gaussians import Gaussians

SIZE_PX = (12, 24)
KEY_TIMES_S = torch.linspace(0.0, 1.0, 2)


def shown(depth: Tensor, focal_px: float = 300.0, **changes: object) -> ImageLayer:
    size = (depth.shape[0], depth.shape[1])
    return layer(depth, camera=pinhole(focal_px, size), in_image=True, **changes)


def slanted(across: float, down: float = 0.0, focal_px: float = 300.0) -> ImageLayer:
    """A surface whose log depth grows evenly from cell to cell."""
    rows, columns = torch.meshgrid(*map(torch.arange, SIZE_PX), indexing="ij")
    return shown((1.0 + across * columns + down * rows).exp(), focal_px)


def sheared(image: ImageLayer) -> Gaussians:
    return in_steep_surface(layer_gaussians(image), image)


def is_round(image: ImageLayer) -> bool:
    return sheared(image).scales.equal(layer_gaussians(image).scales)


def covariances(gaussians: Gaussians) -> Tensor:
    axes = (quaternion.to_matrix(gaussians.quats) * gaussians.scales[:, None]).double()
    return axes @ axes.mT


@pytest.mark.parametrize(("across", "down"), [(0.05, 0.0), (-0.055, 0.0), (0.03, -0.04)])
def test_the_input_view_sees_what_it_saw(across: float, down: float) -> None:
    image = slanted(across, down)
    before, found = layer_gaussians(image), sheared(image)
    assert bool((found.scales.amax(1) > 2 * before.scales.amax(1)).all())
    rays = world_rays(image.camera)[1].reshape(-1, 3).double()
    across_ray = torch.eye(3) - rays[:, :, None] * rays[:, None]
    variance = before.scales[:, 0].double().square()[:, None, None]
    seen = across_ray @ covariances(found) @ across_ray / variance
    torch.testing.assert_close(seen, across_ray, atol=2e-4, rtol=0)


def test_they_lie_in_the_surface() -> None:
    image = slanted(0.05, 0.03)
    points, found = unproject(image.camera, image.depth), sheared(image)
    across, down = torch.gradient(points, dim=(1, 0))
    normal = torch.nn.functional.normalize(torch.linalg.cross(across, down), dim=-1).double()
    spread = covariances(found).unflatten(0, SIZE_PX)
    thickness = torch.einsum("hwi,hwij,hwj->hw", normal, spread, normal).sqrt()
    width = layer_gaussians(image).scales[:, 0].view(SIZE_PX).double()
    assert float((thickness / width)[1:-1, 1:-1].max()) < 0.15


def test_the_longest_scale_is_that_of_the_shear() -> None:
    image, slope = slanted(0.05, focal_px=100.0), 0.05 * 100
    found, before = sheared(image), layer_gaussians(image)
    torch.testing.assert_close(found.scales.prod(1), before.scales.prod(1), rtol=1e-4, atol=0)
    middle = (SIZE_PX[0] // 2) * SIZE_PX[1] + SIZE_PX[1] // 2
    ratio = float(found.scales[middle].amax() / before.scales[middle, 0])
    assert ratio == pytest.approx((slope + math.sqrt(slope**2 + 4)) / 2, rel=0.01)


def test_a_steep_surface_has_no_gaps_from_beside() -> None:
    image = replace(slanted(0.05), opacity=0.999)
    target = unproject(image.camera, image.depth)[SIZE_PX[0] // 2, SIZE_PX[1] // 2]
    angle = math.radians(-15)
    eye = target - target.norm() * torch.tensor([math.sin(-angle), 0.0, math.cos(angle)])
    beside = image.camera.with_pose(look_at(eye, target, torch.tensor([0.0, 1.0, 0.0])))

    def least_alpha(gaussians: Gaussians) -> float:
        alpha = render(gaussians, beside, outputs=("alpha",), settings=UNDILATED).alpha
        return float(alpha[4:-4, 10:14].min())

    assert least_alpha(layer_gaussians(image)) < 0.2
    assert least_alpha(sheared(image)) > 0.8


def test_flat_surfaces_edges_and_ridges_stay_round() -> None:
    assert is_round(slanted(0.9 * LEAST_SLOPE / 300 / 1.1))
    assert not is_round(slanted(1.2 * LEAST_SLOPE / 300))
    assert is_round(slanted(1.1 * DEPTH_STEP))
    edge = slanted(0.0)
    edge.depth[:, 12:] *= 3
    assert is_round(edge)
    edge.depth[:, 12] *= 0.8
    assert is_round(edge)
    ridges = slanted(0.0)
    ridges.depth[:, ::2] *= 1.03
    inner = torch.zeros(SIZE_PX, dtype=torch.bool)
    inner[:, 1:-1] = True
    assert is_round(replace(ridges, mask=inner))


@pytest.mark.parametrize("in_surface", [True, False])
def test_a_layer_says_whether_it_is_sheared(in_surface: bool) -> None:
    image = replace(slanted(0.05), in_surface=in_surface)
    found = image_gaussians(layered(image), KEY_TIMES_S).gaussians
    assert found.scales.equal(layer_gaussians(image).scales) != in_surface


def test_pixels_and_infill_are_sheared_where_networks_see_a_smaller_copy() -> None:
    large = input_image(random_rgb(32, 32))
    for small in (input_image(random_rgb(8, 8)), large):
        maps = ImageMaps(depth=torch.ones(small.rgb.shape[:2]), displacement=None)
        pixels = pixel_layer(small, large, maps)
        is_reduced = small is not large
        assert pixels.in_surface == subpixel_infill(pixels).in_surface == is_reduced


def test_what_moves_stays_round() -> None:
    image = slanted(0.05)
    moving = torch.arange(SIZE_PX[1]).expand(SIZE_PX) < 8
    displacement = torch.zeros(3, *SIZE_PX, 3)
    displacement[1, moving] = torch.tensor([0.1, 0.0, 0.0])
    every, found = sheared(image), sheared(replace(image, displacement=displacement))
    is_static = ~moving.flatten()
    assert found.scales[is_static].equal(every.scales[is_static])
    assert found.scales[~is_static].equal(layer_gaussians(image).scales[~is_static])


def test_cells_without_a_surface_have_no_gaussian() -> None:
    image = slanted(0.05)
    mask = torch.arange(SIZE_PX[0] * SIZE_PX[1]).view(SIZE_PX) % 3 > 0
    every, found = sheared(image), sheared(replace(image, mask=mask))
    chosen = mask.flatten()
    assert found.scales.equal(every.scales[chosen]) and found.quats.equal(every.quats[chosen])


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1), (7, 9)])
def test_extreme_depths_stay_finite(limits: tuple[float, float], size: tuple[int, int]) -> None:
    found = sheared(shown(random_depth(*size, limits), focal_px=1e4))
    assert bool((found.scales.isfinite() & (found.scales > 0)).all())
    torch.testing.assert_close(found.quats.norm(dim=1), torch.ones(size[0] * size[1]))
