"""Smoothing of upsampled depth: against the linear system it solves, at edges and extremes."""

import cv2
import pytest
import torch
from image_layers import FAR_RANGES, random_depth, random_rgb

from diff4splat.generation.layered_image.pixel_maps.depth_smoothing import smooth_depth, smooth_maps
from diff4splat.generation.layered_image.pixel_maps.upsampling import upsample_maps

SIDE_PX = 24


def grey(height: int, width: int) -> torch.Tensor:
    return torch.full((height, width, 3), 0.5)


def stairs() -> torch.Tensor:
    """Depth in cells of four pixels."""
    steps = torch.linspace(3.0, 5.0, SIDE_PX // 4).repeat_interleave(4)
    return steps.expand(SIDE_PX, SIDE_PX).contiguous()


def test_stairs_of_one_colour_become_a_ramp() -> None:
    steps = smooth_depth(stairs(), grey(SIDE_PX, SIDE_PX)).diff(dim=1)[:, 4:-4]
    assert float(steps.min()) > 0, "depth rises with every pixel"
    assert float(steps.max()) < 0.3 * float(stairs().diff(dim=1).max())


def test_a_step_of_depth_at_a_step_of_colour_stays() -> None:
    rgb, depth = grey(SIDE_PX, SIDE_PX), torch.full((SIDE_PX, SIDE_PX), 2.0)
    rgb[:, 10:], depth[:, 10:] = 1.0, 8.0
    torch.testing.assert_close(smooth_depth(depth, rgb), depth, rtol=1e-3, atol=0)


def test_a_step_of_depth_within_one_colour_is_spread() -> None:
    depth = torch.full((SIDE_PX, SIDE_PX), 2.0)
    depth[:, 12:] = 8.0
    smooth = smooth_depth(depth, grey(SIDE_PX, SIDE_PX))
    assert float(smooth.diff(dim=1).max()) < 0.5 * 6.0


def test_cells_of_a_tilted_plane_leave_no_blocks() -> None:
    """Upsampling and smoothing together: nearer to the plane's slope than upsampling alone."""
    width = 128
    plane = 1 / torch.linspace(0.5, 0.1, width).expand(16, width)
    cells = 1 / (1 / plane).unflatten(0, (-1, 4)).unflatten(2, (-1, 4)).mean((1, 3))
    full = grey(16, width)
    blocks, _ = upsample_maps(cells, None, (grey(4, width // 4), full))
    # Of steps from pixel to pixel; the smoother levels what is near the image's sides.
    inner = slice(width // 4, -width // 4)
    errors = [
        ((1 / one) - (1 / plane)).diff(dim=1)[:, inner].square().mean()
        for one in (blocks, smooth_depth(blocks, full))
    ]
    assert float(errors[1]) < 0.1 * float(errors[0])


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (5, 7)])
@pytest.mark.parametrize("limits", [*FAR_RANGES, (1e-30, 1e-29), (1e29, 1e30)])
def test_any_depth_stays_in_its_range(limits: tuple[float, float], size: tuple[int, int]) -> None:
    depth = random_depth(*size, limits)
    smooth = smooth_depth(depth, random_rgb(*size))
    assert bool(smooth.isfinite().all()) and smooth.shape == depth.shape
    assert bool((smooth >= depth.min()).all()) and bool((smooth <= depth.max()).all())


def test_a_constant_depth_stays_constant() -> None:
    depth = torch.full((SIDE_PX, SIDE_PX), 7.0)
    torch.testing.assert_close(smooth_depth(depth, random_rgb(SIDE_PX, SIDE_PX)), depth)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_unit_does_not_matter(factor: float) -> None:
    depth, rgb = random_depth(9, 9, (1.0, 9.0)), random_rgb(9, 9)
    torch.testing.assert_close(smooth_depth(factor * depth, rgb), factor * smooth_depth(depth, rgb))


def test_bits_do_not_depend_on_threads() -> None:
    depth, rgb = random_depth(64, 96, (1.0, 9.0)), random_rgb(64, 96)
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        alone = smooth_depth(depth, rgb)
        cv2.setNumThreads(4)
        assert torch.equal(alone, smooth_depth(depth, rgb))
    finally:
        cv2.setNumThreads(before)


def test_displacement_keeps_its_path_in_the_image() -> None:
    depth, rgb = random_depth(9, 9, (1.0, 9.0)), random_rgb(9, 9)
    displacement = torch.randn(3, 9, 9, 3)
    smooth, moved = smooth_maps(depth, displacement, rgb)
    torch.testing.assert_close(moved / smooth[..., None], displacement / depth[..., None])
    assert smooth_maps(depth, None, rgb)[1] is None
