import oracles_paths
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.geometry.camera import project
from diff4splat.paths.resize import fitted, resized

SIDES = st.integers(1, 4000)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 50))
def test_the_same_aspect_ratio_is_a_plain_resize(factor: int) -> None:
    cameras = oracles_paths.random_path(0, 3).cameras
    found = fitted(cameras, (48 * factor, 64 * factor))
    expected = cameras.resized((48 * factor, 64 * factor))
    torch.testing.assert_close(found.focal_px, expected.focal_px)
    torch.testing.assert_close(found.center_px, expected.center_px)
    assert found.size_px == expected.size_px


@settings(max_examples=25, deadline=None)
@given(SIDES, SIDES)
def test_pixels_keep_their_shape_and_points_their_place(height: int, width: int) -> None:
    cameras = oracles_paths.random_path(1, 3).cameras
    found = fitted(cameras, (height, width))
    points = 5 * torch.randn(3, 7, 3, dtype=torch.float64)
    before, _ = project(cameras, points)
    after, _ = project(found, points)
    # Scaling to cover and cropping to the middle, written for the pixels themselves.
    factor = max(height / 48, width / 64)
    middle, new_middle = before.new_tensor([32, 24]), before.new_tensor([width / 2, height / 2])
    torch.testing.assert_close(after, (before - middle) * factor + new_middle)


def test_a_square_cut_of_a_wide_image() -> None:
    path = oracles_paths.random_path(2, 3, centered=True)
    found = resized(path, (24, 24))
    torch.testing.assert_close(found.cameras.focal_px, path.cameras.focal_px / 2)
    assert found.cameras.center_px[0].tolist() == pytest.approx([12, 12])
    assert found.cameras.size_px == (24, 24)
    assert torch.equal(found.times_s, path.times_s)
    assert torch.equal(found.cameras.world_from_camera, path.cameras.world_from_camera)
