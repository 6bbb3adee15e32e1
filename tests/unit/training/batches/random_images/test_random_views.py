"""Random views of images with depth: window, zoom, roll, and photograph-like colour."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.random_images.random_views import (
    DRAWS,
    GREY_SHARE,
    LEVEL_SHARE,
    SOFT_SHARE,
    WHOLE_SHARE,
    depth_images,
    random_photo,
    random_views,
)

WHOLE = 0.5 * WHOLE_SHARE
PART = 0.5 * (1 + WHOLE_SHARE)
LEVEL = 0.5 * LEVEL_SHARE


def ramp_images(height: int = 64, width: int = 96) -> tuple[Tensor, Tensor]:
    """Red and depth grow to the right, green downwards."""
    y, x = torch.meshgrid(torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij")
    rgb = torch.stack([x / width, y / height, torch.zeros_like(x)])
    return rgb[None], (1 + x / width)[None]


def draws_of(*values: float) -> Tensor:
    return torch.tensor([values])


def test_a_whole_view_of_the_same_size_is_the_image() -> None:
    images = depth_images(*ramp_images())
    view = random_views(images, (64, 96), draws_of(WHOLE, 0.9, 0.3, 0.2, 0.8))
    inner = (..., slice(1, -1), slice(1, -1))
    torch.testing.assert_close(view.rgb[inner], images.rgb[inner], atol=1e-4, rtol=0)
    torch.testing.assert_close(view.depth, images.depth)


def test_depth_follows_colour_under_zoom_roll_and_shift() -> None:
    images = depth_images(*ramp_images())
    draws = torch.rand(64, DRAWS, generator=torch.Generator().manual_seed(0))
    draws[:, 0] = PART
    each = [random_views(images, (32, 48), one[None]) for one in draws]
    for view in each:
        ratio = view.depth[0] / (1 + view.rgb[0, 0])
        # Nearest pixels are at most half a pixel off.
        assert float(ratio.max() / ratio.min()) < 1 + 2 / 96
        assert bool(view.known.all())
        assert float(view.depth.median()) == pytest.approx(PLANE_DEPTH, rel=1e-5)


def test_a_level_view_of_largest_zoom_reaches_the_nearer_edges() -> None:
    images = depth_images(*ramp_images())
    view = random_views(images, (64, 64), draws_of(PART, LEVEL, 1.0, 0.0, 0.5))
    torch.testing.assert_close(
        view.rgb[0, 0, :, 1:-1], images.rgb[0, 0, :, 1:63], atol=1e-4, rtol=0
    )


def test_roll_turns_the_ramp() -> None:
    images = depth_images(*ramp_images(96, 96))
    for draw, sign in ((0.999, 1), (LEVEL_SHARE + 0.001, -1)):
        red = random_views(images, (32, 32), draws_of(PART, draw, 0.0, 0.5, 0.5)).rgb[0, 0]
        across = float((red[16, 24] - red[16, 8]) / 16)
        down = float((red[24, 16] - red[8, 16]) / 16)
        assert math.degrees(math.atan2(-down, across)) == pytest.approx(sign * 25, abs=0.5)


def test_unknown_depth_stays_unknown() -> None:
    rgb, depth = ramp_images()
    depth[:, :32] = 0
    images = depth_images(rgb, depth)
    view = random_views(images, (64, 96), draws_of(WHOLE, 0.0, 0.0, 0.0, 0.0))
    assert not view.known[:, :32].any() and bool(view.known[:, 32:].all())
    nothing = depth_images(rgb, torch.zeros_like(depth))
    empty = random_views(nothing, (32, 32), draws_of(PART, 0.9, 0.5, 0.5, 0.5))
    assert not empty.known.any() and bool((empty.depth == 1).all())


@settings(max_examples=60, deadline=None)
@given(
    draws=st.lists(st.floats(0, 1, width=32), min_size=DRAWS, max_size=DRAWS),
    source=st.tuples(st.integers(8, 80), st.integers(8, 80)),
    size=st.tuples(st.integers(1, 5), st.integers(1, 5)),
)
def test_every_view_lies_within_its_image(
    draws: list[float], source: tuple[int, int], size: tuple[int, int]
) -> None:
    # Outside of the image samples would repeat the border: red and green would leave their ramps.
    images = depth_images(*ramp_images(*source))
    view = random_views(images, (16 * size[0], 16 * size[1]), draws_of(*draws))
    assert view.rgb.shape[2:] == (16 * size[0], 16 * size[1])
    assert bool(view.rgb.isfinite().all()) and bool(view.depth.isfinite().all())
    assert float(view.rgb.min()) >= 0 and float(view.rgb.max()) <= 1
    corners = view.rgb[0, :2, [0, 0, -1, -1], [0, -1, 0, -1]]
    # A parallelogram: opposite corners have the same mean unless one was clamped at the border.
    middle = corners[:, [0, 3]].mean(1) - corners[:, [1, 2]].mean(1)
    assert float(middle.abs().max()) <= 1 / min(source)


SAME = (1 / 1.96, 0.0, 0.0, 1.0, 1.0)
"""Draws that leave a photo as it is."""


def photo(rgb: Tensor, noise: float = 0.0, **changes: float) -> Tensor:
    names = ("saturation", "vignette", "grain", "colorless", "soft")
    draws = [changes.get(name, same) for name, same in zip(names, SAME, strict=True)]
    return random_photo(
        rgb, torch.tensor([draws]).expand(len(rgb), -1), noise * torch.randn_like(rgb)
    )


def test_colours_without_change_stay_and_noise_is_bounded() -> None:
    rgb = torch.rand(2, 3, 8, 8)
    torch.testing.assert_close(photo(rgb), rgb)
    noisy = photo(rgb, 100.0, vignette=1.0, grain=1.0)
    assert float(noisy.min()) >= 0 and float(noisy.max()) <= 1


@pytest.mark.parametrize("change", [{"saturation": 0.0}, {"colorless": 0.5 * GREY_SHARE}])
def test_some_photos_are_grey(change: dict[str, float]) -> None:
    rgb = torch.rand(2, 3, 8, 8)
    torch.testing.assert_close(photo(rgb, **change), rgb.mean(1, keepdim=True).expand_as(rgb))
    torch.testing.assert_close(photo(rgb, colorless=GREY_SHARE), rgb)


def test_a_soft_photo_keeps_flat_regions_and_loses_detail() -> None:
    flat = torch.full((1, 3, 8, 8), 0.25)
    torch.testing.assert_close(photo(flat, soft=0.0), flat)
    checker = torch.tensor([[0.0, 1.0], [1.0, 0.0]]).repeat(4, 4).expand(1, 3, -1, -1)
    torch.testing.assert_close(photo(checker, soft=0.0), torch.full_like(checker, 0.5))
    torch.testing.assert_close(photo(checker, soft=SOFT_SHARE), checker)
