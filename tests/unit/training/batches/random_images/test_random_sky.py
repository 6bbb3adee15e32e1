"""Other skies: only sky changes, in some images, to a gradient."""

import pytest
import torch
from torch import Tensor

from diff4splat.training.batches.random_images.random_sky import (
    DARK_SHARE,
    SKY_DRAWS,
    SKY_SHARE,
    random_sky,
)

ABOVE, BELOW = (0.1, 0.2, 0.3), (0.9, 0.8, 0.7)


def draws(chosen: float = 0.0, clouds: float = 0.0, bright: float = 1.0) -> Tensor:
    values = torch.tensor([[chosen, clouds, *ABOVE, *BELOW, bright]])
    assert values.shape[1] == SKY_DRAWS
    return values


def half_sky() -> Tensor:
    """Known below the middle row."""
    known = torch.zeros(1, 8, 6, dtype=torch.bool)
    known[:, 4:] = True
    return known


def test_only_sky_changes_and_runs_from_one_colour_toward_the_other() -> None:
    rgb = torch.rand(1, 3, 8, 6)
    changed = random_sky(rgb, half_sky(), draws())
    torch.testing.assert_close(changed[:, :, 4:], rgb[:, :, 4:])
    for row in range(4):
        want = torch.tensor(ABOVE) + row / 7 * (torch.tensor(BELOW) - torch.tensor(ABOVE))
        torch.testing.assert_close(changed[0, :, row], want[:, None].expand(-1, 6))


def test_clouds_are_those_of_the_sky() -> None:
    rgb = 0.4 + 0.2 * torch.rand(1, 3, 8, 6)
    plain, cloudy = (random_sky(rgb, half_sky(), draws(clouds=share)) for share in (0.0, 0.5))
    own = rgb[:, :, :4] - rgb[:, :, :4].mean((2, 3), keepdim=True)
    torch.testing.assert_close((cloudy - plain)[:, :, :4], 0.5 * own, atol=1e-6, rtol=0)


def test_some_skies_are_dark_down_to_black() -> None:
    rgb = torch.rand(1, 3, 8, 6)
    light, half, black = (
        random_sky(rgb, half_sky(), draws(bright=share))[:, :, :4]
        for share in (DARK_SHARE, DARK_SHARE / 2, 0.0)
    )
    torch.testing.assert_close(half, light / 2)
    assert float(black.max()) == 0


@pytest.mark.parametrize("known", [torch.zeros(1, 8, 6) > 0, torch.ones(1, 8, 6) > 0])
def test_without_depth_or_without_sky_nothing_changes(known: Tensor) -> None:
    rgb = torch.rand(1, 3, 8, 6)
    torch.testing.assert_close(random_sky(rgb, known, draws()), rgb)


def test_other_images_keep_their_sky() -> None:
    rgb = torch.rand(1, 3, 8, 6)
    torch.testing.assert_close(random_sky(rgb, half_sky(), draws(chosen=SKY_SHARE)), rgb)


def test_colours_stay_in_range_and_finite() -> None:
    generator = torch.Generator().manual_seed(0)
    rgb, known = torch.rand(64, 3, 8, 6, generator=generator), half_sky().expand(64, -1, -1)
    changed = random_sky(rgb, known, torch.rand(64, SKY_DRAWS, generator=generator))
    assert bool(changed.isfinite().all()) and changed.min() >= 0 and changed.max() <= 1
    assert bool((changed != rgb).any(1).flatten(1).any(1).float().mean() > SKY_SHARE / 2)
