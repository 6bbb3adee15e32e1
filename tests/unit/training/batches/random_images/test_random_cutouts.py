"""Cutouts in images: one depth each, behind what is nearer, and nothing where they do not count."""

import pytest
import torch
from torch import Tensor

from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.random_images.random_cutouts import (
    CUTOUT_DRAWS,
    CUTOUT_SHARE,
    HIGH_SHARE,
    LIGHTS,
    NEARNESS,
    with_cutouts,
)
from diff4splat.training.batches.random_images.random_views import DepthImages, depth_images

HEIGHT, WIDTH = 40, 60
RED = torch.tensor([1.0, 0.0, 0.0])
FULL_LIGHT = (1 - LIGHTS[0]) / (LIGHTS[1] - LIGHTS[0])


def block() -> Tensor:
    """One red cutout that fills its square."""
    square = torch.zeros(1, 4, 16, 16, dtype=torch.uint8)
    square[:, 0], square[:, 3] = 255, 255
    return square


def ground(known: Tensor | None = None) -> DepthImages:
    """Depth falls from 8 at the top to 4 at the bottom."""
    depth = torch.linspace(8, 4, HEIGHT)[:, None].expand(1, HEIGHT, WIDTH).contiguous()
    depth = depth if known is None else torch.where(known, depth, 0.0)
    return depth_images(torch.full((1, 3, HEIGHT, WIDTH), 0.5), depth)


def draws(**changed: float) -> Tensor:
    """A standing cutout in the middle whose foot is within the image."""
    values = {
        "used": 0.0, "which": 0.0, "height": 0.4, "x": 0.5, "foot": 0.4, "mirrored": 0.0,
        "high": 1.0, "near": 0.5, "light": FULL_LIGHT,
    }  # fmt: skip
    row = torch.tensor([list((values | changed).values())])
    assert row.shape[1] == CUTOUT_DRAWS
    return row


def painted(images: DepthImages) -> Tensor:
    """Pixels that are red."""
    return ((images.rgb - RED[:, None, None]).abs() < 1e-3).all(1)


def test_a_standing_cutout_has_the_depth_of_the_surface_at_its_foot() -> None:
    before, after = ground(), with_cutouts(ground(), block(), draws())
    red = painted(after)[0]
    rows = red.any(1).nonzero()
    assert red.any() and not red.all()
    unit = after.depth[0, 0, 0] / before.depth[0, 0, 0]
    values = after.depth[0][red] / unit
    assert float(values.max() - values.min()) < 1e-5
    # Its foot is at 72 % of the height.
    assert float(values[0]) == pytest.approx(float(before.depth[0, int(0.72 * HEIGHT), 0]), 1e-4)
    assert int(rows.max()) <= int(0.72 * HEIGHT)
    side = 0.2 * 6.5**0.4 * HEIGHT
    assert int(rows.min()) == pytest.approx(0.72 * HEIGHT - side, abs=2)
    torch.testing.assert_close(after.rgb[:, :, ~red][..., :3], before.rgb[:, :, ~red][..., :3])


def test_what_is_nearer_hides_it() -> None:
    images = ground()
    images.depth[..., : WIDTH // 2] = 0.1
    after = with_cutouts(images, block(), draws())
    red = painted(after)[0]
    assert red.any() and not red[:, : WIDTH // 2].any()


def test_a_high_cutout_is_nearer_than_all_that_it_covers() -> None:
    before = ground()
    after = with_cutouts(before, block(), draws(high=HIGH_SHARE - 0.01, near=0.0))
    depth = after.depth[0] * (before.depth[0, 0, 0] / after.depth[0, 0, 0])
    covered = (depth - before.depth[0]).abs() > 1e-4
    nearest = float(before.depth[0][covered].min())
    assert bool(painted(after)[0].any())
    assert float(depth[covered].max()) == pytest.approx(NEARNESS[0] * nearest, 1e-4)


def test_below_the_lower_edge_it_is_nearer_than_the_surface() -> None:
    before = ground()
    after = with_cutouts(before, block(), draws(foot=0.99, height=0.7, near=0.5))
    red = painted(after)[0]
    unit = after.depth[0, 0, 0] / before.depth[0, 0, 0]
    near = sum(NEARNESS) / 2 * float(before.depth[0, -1, 0])
    assert float(after.depth[0][red][0] / unit) == pytest.approx(near, 1e-4)


def test_before_the_sky_it_is_known() -> None:
    known = torch.zeros(1, HEIGHT, WIDTH, dtype=torch.bool)
    known[:, -4:] = True
    after = with_cutouts(ground(known), block(), draws(foot=0.2, height=0.6))
    red = painted(after)
    assert red.any() and bool(after.known[red].all())
    assert bool((after.depth[red] > 0).all()) and float(after.depth[red].max()) <= PLANE_DEPTH


@pytest.mark.parametrize(
    ("changed", "known"),
    [
        ({"used": CUTOUT_SHARE}, None),
        ({}, torch.zeros(1, HEIGHT, WIDTH, dtype=torch.bool)),
        ({"foot": 0.99, "height": 0.0, "x": 0.0, "high": 1.0}, None),
    ],
    ids=["not used", "without depth", "outside"],
)
def test_other_images_stay_as_they_are(changed: dict, known: Tensor | None) -> None:
    before = ground(known)
    after = with_cutouts(before, block(), draws(**changed))
    torch.testing.assert_close(after.rgb, before.rgb)
    torch.testing.assert_close(after.depth, before.depth)
    assert torch.equal(after.known, before.known)


def test_mirrored_cutouts_are_mirrored() -> None:
    half = block()
    half[..., 8:] = 0
    left, right = (
        painted(with_cutouts(ground(), half, draws(mirrored=value))) for value in (0.0, 1.0)
    )
    assert torch.equal(left.flip(-1), right) and not torch.equal(left, right)


def test_values_stay_finite_and_in_range() -> None:
    generator = torch.Generator().manual_seed(0)
    known = torch.rand(64, HEIGHT, WIDTH, generator=generator) > 0.3
    known[:4] = False
    depth = torch.rand(64, HEIGHT, WIDTH, generator=generator) * 1e6 * known
    rgb = torch.rand(64, 3, HEIGHT, WIDTH, generator=generator)
    chosen = torch.rand(64, CUTOUT_DRAWS, generator=generator)
    after = with_cutouts(depth_images(rgb, depth), block(), chosen)
    assert bool(after.rgb.isfinite().all()) and bool(after.depth.isfinite().all())
    assert float(after.rgb.min()) >= 0 and float(after.rgb.max()) <= 1
    assert float(after.depth.min()) >= 0
