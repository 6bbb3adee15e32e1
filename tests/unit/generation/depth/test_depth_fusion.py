"""One depth map from several: shares of the encoders, and the spread of the mean."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from diff4splat.generation.depth.fusion import (
    BACKBONE_SHARE,
    IN_DOMAIN,
    MOST_STRETCH,
    NEAR_RELIEF,
    OUT_OF_DOMAIN,
    fused,
    out_of_domain_score,
)


def fuse(maps: Tensor) -> Tensor:
    return fused(maps, out_of_domain_score(maps))


def random_maps(passes: int = 3, encoders: int = 2, seed: int = 0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(passes, encoders, 5, 7, generator=generator, dtype=torch.float64)


def spread(values: Tensor) -> float:
    """Mean absolute difference from the (lower) median, one number after the other."""
    ordered = sorted(values.flatten().tolist())
    middle = ordered[(len(ordered) - 1) // 2]
    return sum(abs(value - middle) for value in ordered) / len(ordered)


def centred(values: Tensor) -> Tensor:
    return values - values.flatten().median()


def from_the_formula(maps: Tensor) -> Tensor:
    passes = [[centred(one) for one in both] for both in maps]
    spreads = [[spread(one) for one in both] for both in passes]
    mean_spread = sum(map(sum, spreads)) / (2 * len(passes))
    difference = sum(float((a - b).abs().mean()) for a, b in passes) / len(passes)
    score = (difference / mean_spread - IN_DOMAIN) / (OUT_OF_DOMAIN - IN_DOMAIN)
    score = min(1, max(0, score))
    share = 0.5 + (BACKBONE_SHARE - 0.5) * score
    mean = sum(share * a + (1 - share) * b for a, b in passes) / len(passes)
    wanted = sum(share * a + (1 - share) * b for a, b in spreads) / len(passes)
    relief = centred(mean) * min(MOST_STRETCH, wanted / spread(mean))
    return relief + relief.clamp_max(0) * score * (NEAR_RELIEF - 1)


def alike(difference: float) -> Tensor:
    """Two ramps of spread 1 whose mean difference is about ``difference``."""
    ramp = torch.linspace(-2, 2, 101, dtype=torch.float64).expand(101, 101)
    angle = torch.tensor(difference / 2).asin() * 2
    return torch.stack([ramp, angle.cos() * ramp + angle.sin() * ramp.T])[None]


@pytest.mark.parametrize("seed", range(5))
def test_the_fused_map_follows_from_the_formula(seed: int) -> None:
    maps = random_maps(seed=seed)
    maps[:, 1] = 0.6 * maps[:, 0] + (0.2 + 0.2 * seed) * maps[:, 1]
    torch.testing.assert_close(fuse(maps), from_the_formula(maps))


def test_encoders_that_agree_are_left_as_they_are() -> None:
    one = random_maps(1, 1).expand(4, 2, 5, 7)
    torch.testing.assert_close(fuse(one), centred(one[0, 0]))
    assert float(out_of_domain_score(one)) == 0


def test_an_image_is_the_farther_out_of_domain_the_more_its_encoders_disagree() -> None:
    found = [
        float(out_of_domain_score(alike(difference))) for difference in (0.3, 0.9, 1.0, 1.1, 1.8)
    ]
    assert found[0] == 0 and found[-1] == 1
    assert found == sorted(found) and 0 < found[2] < 1


def test_the_backbone_counts_more_out_of_domain() -> None:
    first, second = torch.eye(6), torch.eye(6).flip(0)
    found = fuse(torch.stack([first, second])[None].double())
    assert float((found * first).sum()) > 1.5 * float((found * second).sum()) > 0


def test_the_mean_of_different_maps_has_their_spread() -> None:
    ramp = torch.linspace(-1, 1, 21, dtype=torch.float64).expand(21, 21)
    maps = torch.stack([ramp, ramp.T])[:, None]
    assert spread(maps.mean((0, 1))) < 0.75 * spread(ramp)
    assert spread(fuse(maps)) == pytest.approx(spread(ramp))


@pytest.mark.parametrize("score", [0.0, 0.5, 1.0])
def test_what_is_near_has_more_relief_out_of_domain_and_the_rest_as_much(score: float) -> None:
    symmetric = alike(1.8)
    found = fused(symmetric, torch.tensor(score, dtype=torch.float64))
    factor = 1 + (NEAR_RELIEF - 1) * score
    assert -float(found.min()) == pytest.approx(factor * float(found.max()))


def test_maps_that_contradict_each_other_are_not_blown_up() -> None:
    one = random_maps(1, 1)
    found = fuse(torch.cat([one, 0.01 * one - one]))
    assert spread(found) <= MOST_STRETCH * 0.01 * spread(one)


@pytest.mark.parametrize("encoders", [1, 2])
@pytest.mark.parametrize("value", [0.0, -80.0, 80.0])
def test_flat_maps_stay_flat(encoders: int, value: float) -> None:
    found = fuse(torch.full((2, encoders, 3, 4), value))
    assert torch.equal(found, torch.zeros(3, 4))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.floats(-50, 50), st.floats(0.01, 20))
def test_units_do_not_matter(seed: int, shift: float, factor: float) -> None:
    maps = random_maps(seed=seed)
    torch.testing.assert_close(fuse(factor * maps + shift), factor * fuse(maps))
    torch.testing.assert_close(
        out_of_domain_score(factor * maps + shift), out_of_domain_score(maps)
    )


def test_every_map_may_have_a_unit_of_its_own() -> None:
    maps = alike(1.0).repeat(3, 1, 1, 1)
    shifted = maps + torch.randn(3, 2, 1, 1, dtype=torch.float64)
    torch.testing.assert_close(out_of_domain_score(shifted), out_of_domain_score(maps))
    torch.testing.assert_close(fuse(shifted), fuse(maps))
