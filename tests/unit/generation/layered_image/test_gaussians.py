"""From layers to Gaussians: order, masks, and displacements at key times."""

from dataclasses import fields, replace

import pytest
import torch
from image_layers import FAR_RANGES, FOCAL_PX, layer, layered, random_depth
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import (
    image_gaussians,
    layer_gaussians,
    layers_motion,
)
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import pinhole, project, stack_cameras
from diff4splat.geometry.depth import distance_from_depth
from diff4splat.models.config.networks import GAUSSIAN_SPLIT, ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.scene.harmonics import color_from_dc
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion

SIZE_PX = (4, 6)
KEY_TIMES_S = torch.linspace(0.0, 2.0, 9)


def some_layer(seed: int = 0, **changes: object) -> ImageLayer:
    return layer(random_depth(*SIZE_PX, (1.0, 9.0), seed), **changes)


def checkered() -> Tensor:
    return (torch.arange(24) % 3 > 0).view(SIZE_PX)


def test_each_valid_cell_is_a_gaussian_at_its_place_in_row_order() -> None:
    image = some_layer(mask=checkered())
    gaussians = layer_gaussians(image)
    assert len(gaussians) == 16
    pixels, z = project(image.camera, gaussians.means)
    rows, columns = torch.meshgrid(*map(torch.arange, SIZE_PX), indexing="ij")
    centers = torch.stack([columns, rows], -1)[checkered()] + 0.5
    torch.testing.assert_close(pixels, centers, atol=1e-4, rtol=0)
    torch.testing.assert_close(z, image.depth[checkered()])
    torch.testing.assert_close(color_from_dc(gaussians.sh[:, 0]), image.rgb[checkered()])
    torch.testing.assert_close(gaussians.opacities, torch.full((16,), image.opacity))
    footprint = image.footprint_px * z / FOCAL_PX
    torch.testing.assert_close(gaussians.scales, footprint[:, None].expand(-1, 3))


def test_gaussians_are_those_of_the_reconstruction_head_before_it_corrects_them() -> None:
    turned = quaternion.to_matrix(torch.tensor([0.9, 0.2, -0.3, 0.1]))
    pose = rigid.from_parts(turned, torch.tensor([0.4, -1.0, 2.0]))
    camera = replace(pinhole(FOCAL_PX, SIZE_PX), focal_px=torch.tensor([18.0, 26.0]))
    image = some_layer(mask=checkered(), camera=camera.with_pose(pose))
    cameras = stack_cameras([image.camera])
    base = PixelBase(
        rgb=image.rgb[None],
        distance=distance_from_depth(cameras, image.depth[None]),
        opacity=torch.full((1, *SIZE_PX), image.opacity),
        cameras=cameras,
    )
    config = ActivationConfig(footprint_px=image.footprint_px)
    head = activate(torch.zeros(sum(GAUSSIAN_SPLIT), 1, *SIZE_PX), base, config)
    found, wanted = layer_gaussians(image), head.select(checkered().flatten())
    for field in fields(wanted):
        torch.testing.assert_close(getattr(found, field.name), getattr(wanted, field.name))


def test_layers_follow_one_another_with_their_pixels() -> None:
    index = torch.arange(24).view(SIZE_PX)
    parts = (
        some_layer(0, pixel_index=index, in_image=True),
        some_layer(1, mask=checkered()),
        some_layer(2, mask=checkered(), pixel_index=index),
    )
    gathered = image_gaussians(layered(*parts), KEY_TIMES_S)
    expected = torch.cat([layer_gaussians(each).means for each in parts])
    assert torch.equal(gathered.gaussians.means, expected)
    pixels = [*range(24), *[NO_PIXEL] * 16, *index[checkered()].tolist()]
    assert gathered.pixel_index.tolist() == pixels
    assert layered(*parts).visible_count == 24


def oracle(parts: tuple[ImageLayer, ...], fraction: float) -> Tensor:
    """Offsets of all Gaussians at a fraction of the clip, one cell at a time."""
    offsets = []
    for part in parts:
        for row in range(SIZE_PX[0]):
            for column in range(SIZE_PX[1]):
                if not bool(part.mask[row, column]):
                    continue
                if part.displacement is None:
                    offsets.append(torch.zeros(3))
                    continue
                track = part.displacement[:, row, column].double()
                place = fraction * (len(track) - 1)
                before = min(int(place), max(len(track) - 2, 0))
                after = min(before + 1, len(track) - 1)
                share = place - before
                offsets.append(((1 - share) * track[before] + share * track[after]).float())
    return torch.stack(offsets)


@pytest.mark.parametrize("frames", [1, 2, 3])
@pytest.mark.parametrize("keys", [1, 2, 5, 9])
def test_displacements_are_linear_between_latent_frames(frames: int, keys: int) -> None:
    moves = torch.randn(frames, *SIZE_PX, 3) * checkered()[..., None]
    parts = (
        some_layer(0, displacement=moves),
        some_layer(1),
        some_layer(2, displacement=moves.flip(1), mask=checkered()),
    )
    times_s = torch.linspace(0.0, 2.0, keys)
    motion = layers_motion(layered(*parts), times_s)
    assert isinstance(motion, KeyframeMotion) and torch.equal(motion.key_times_s, times_s)
    for key in range(keys):
        expected = oracle(parts, key / max(keys - 1, 1))
        offsets = torch.zeros_like(expected)
        offsets[motion.moving_index] = motion.offsets[key]
        torch.testing.assert_close(offsets, expected, atol=1e-6, rtol=1e-5)
    assert not motion.log_scale_offsets.any()
    assert torch.equal(motion.rotations[..., 0], torch.ones(keys, len(motion.moving_index)))


def test_the_state_at_a_key_time_is_displaced() -> None:
    moves = torch.zeros(2, *SIZE_PX, 3)
    moves[1, 2, 3] = torch.tensor([1.0, 2.0, -3.0])
    gathered = image_gaussians(layered(some_layer(displacement=moves)), KEY_TIMES_S)
    middle = gathered.motion.state_at(gathered.gaussians, 1.0).means - gathered.gaussians.means
    wanted = torch.zeros(24, 3)
    wanted[2 * 6 + 3] = torch.tensor([0.5, 1.0, -1.5])
    torch.testing.assert_close(middle, wanted)


def test_only_displaced_cells_cost_key_times() -> None:
    moves = torch.zeros(3, *SIZE_PX, 3)
    moves[1, 0, 2] = moves[2, 3, 5] = 1.0
    motion = layers_motion(layered(some_layer(), some_layer(displacement=moves)), KEY_TIMES_S)
    assert motion.moving_index.tolist() == [24 + 2, 24 + 23]
    assert motion.offsets.shape == (9, 2, 3)


@pytest.mark.parametrize("still", [None, torch.zeros(3, *SIZE_PX, 3)])
def test_without_displacement_the_motion_is_static(still: Tensor | None) -> None:
    motion = layers_motion(layered(some_layer(displacement=still), some_layer()), KEY_TIMES_S)
    assert isinstance(motion, StaticMotion) and motion.time_range_s == (0.0, 2.0)


def test_layers_without_cells_add_nothing() -> None:
    nothing = torch.zeros(SIZE_PX, dtype=torch.bool)
    empty = some_layer(mask=nothing, displacement=torch.ones(2, *SIZE_PX, 3))
    full = some_layer(1, displacement=torch.ones(2, *SIZE_PX, 3))
    alone, both = (
        image_gaussians(layered(*parts), KEY_TIMES_S) for parts in ((full,), (empty, full))
    )
    assert torch.equal(alone.gaussians.means, both.gaussians.means)
    assert torch.equal(alone.motion.moving_index, both.motion.moving_index)
    assert len(image_gaussians(layered(empty), KEY_TIMES_S).gaussians) == 0


def test_what_a_masked_cell_holds_does_not_matter() -> None:
    image = some_layer(mask=checkered())
    rgb, depth = image.rgb.clone(), image.depth.clone()
    rgb[~checkered()], depth[~checkered()] = 7.0, 1e30
    other = layer_gaussians(replace(image, rgb=rgb, depth=depth))
    for name in ("means", "scales", "sh", "opacities", "quats"):
        assert torch.equal(getattr(other, name), getattr(layer_gaussians(image), name)), name


@pytest.mark.parametrize("limits", FAR_RANGES)
@pytest.mark.parametrize("size", [(1, 5), (5, 1), (1, 1), SIZE_PX])
def test_any_depth_and_size_is_finite(limits: tuple[float, float], size: tuple[int, int]) -> None:
    image = layer(random_depth(*size, limits), displacement=torch.randn(2, *size, 3))
    gathered = image_gaussians(layered(image), KEY_TIMES_S)
    state = gathered.motion.state_at(gathered.gaussians, 0.7)
    for name in ("means", "scales", "quats", "opacities", "sh"):
        assert bool(getattr(state, name).isfinite().all()), name
    assert bool((state.scales > 0).all())
