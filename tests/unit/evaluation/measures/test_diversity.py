"""Spread of several seeds, of known images and of known scenes."""

import pytest
import torch
from oracles_evaluation import filmed, tiny_protocol, wall_and_patch

from diff4splat.evaluation.measures.diversity import KEYS, diversity_entries, pairwise_rms
from diff4splat.evaluation.measures.regions import true_regions
from diff4splat.evaluation.protocols.sample import make_sample


def test_the_spread_is_the_mean_over_pairs() -> None:
    rgb = torch.zeros(3, 2, 4, 5, 3)
    rgb[1], rgb[2] = 0.5, 1.0
    every = torch.ones(2, 4, 5, dtype=torch.bool)
    assert pairwise_rms(rgb, every) == pytest.approx((0.5 + 1.0 + 0.5) / 3)


def test_only_masked_pixels_count() -> None:
    rgb = torch.zeros(2, 1, 4, 5, 3)
    rgb[1, 0, 0] = 1.0
    mask = torch.zeros(1, 4, 5, dtype=torch.bool)
    mask[0, 1:] = True
    assert pairwise_rms(rgb, mask) == 0
    assert pairwise_rms(rgb, ~mask) == 1


def test_equal_seeds_have_no_spread_and_one_seed_has_none_to_measure() -> None:
    case = make_sample(filmed(wall_and_patch((0.9, 0, 0))), tiny_protocol(), "generation")
    regions, scene = true_regions(case), wall_and_patch((0.9, 0, 0))
    assert diversity_entries("row", case, [scene], regions) == []
    same = diversity_entries("row", case, [scene, scene], regions)
    assert [(one.key, one.value) for one in same] == [(key, 0) for key in KEYS]
    other = diversity_entries("row", case, [scene, wall_and_patch()], regions)
    assert other[1].value > other[0].value > 0, "most of it where the patch was"
    unknown = diversity_entries("row", case, [scene, scene], None)
    assert unknown[1].why
