"""Relief that is unsure comes nearer to what is around it, and only there."""

import pytest
import torch

from diff4splat.generation.depth_shrinkage import AROUND, LEAST, UNSURE, shrunk

SIDE = 24
OUT, IN = torch.ones(()), torch.zeros(())


def block() -> tuple[torch.Tensor, torch.Tensor]:
    """A near block on a far ground, and that it is unsure."""
    log_depth, uncertainty = torch.ones(SIDE, SIDE), torch.full((SIDE, SIDE), 0.01)
    log_depth[10:14, 10:14], uncertainty[10:14, 10:14] = 0.0, 2.0
    return log_depth, uncertainty


def from_the_formula(log_depth: torch.Tensor, uncertainty: torch.Tensor, out_of_domain: float):
    found, radius = torch.empty_like(log_depth), max(1, round(min(log_depth.shape) * AROUND))
    weight = 1 / (uncertainty**2 + LEAST**2)
    for row in range(log_depth.shape[0]):
        for column in range(log_depth.shape[1]):
            near = tuple(slice(max(0, at - radius), at + radius + 1) for at in (row, column))
            around = float((weight * log_depth)[near].sum() / weight[near].sum())
            kept = 1 / (1 + out_of_domain * float(uncertainty[row, column] / UNSURE) ** 2)
            found[row, column] = around + kept * (float(log_depth[row, column]) - around)
    return found


@pytest.mark.parametrize("shape", [(9, 13), (1, 1), (3, 40)])
def test_a_shrunk_map_follows_from_the_formula(shape: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(1)
    log_depth = torch.randn(shape, generator=generator, dtype=torch.float64)
    uncertainty = torch.rand(shape, generator=generator, dtype=torch.float64)
    for out_of_domain in (0.0, 0.4, 1.0):
        wanted = from_the_formula(log_depth, uncertainty, out_of_domain)
        found = shrunk(log_depth, uncertainty, torch.tensor(out_of_domain, dtype=torch.float64))
        torch.testing.assert_close(found, wanted)


def test_an_unsure_block_sinks_into_its_ground() -> None:
    log_depth, uncertainty = block()
    found = shrunk(log_depth, uncertainty, OUT)
    assert float(found[10:14, 10:14].min()) > 0.8
    torch.testing.assert_close(found[:6], log_depth[:6])


def test_a_sure_block_stays() -> None:
    log_depth, uncertainty = block()
    found = shrunk(log_depth, uncertainty.clamp_max(0.01), OUT)
    assert float((found - log_depth).abs().max()) < 0.01


def test_an_image_like_those_of_training_stays_as_it_is() -> None:
    log_depth, uncertainty = block()
    torch.testing.assert_close(shrunk(log_depth, uncertainty, IN), log_depth)


@pytest.mark.parametrize("uncertainty", [0.0, 0.0025, 7.4])
def test_extreme_maps_stay_finite_and_within_their_range(uncertainty: float) -> None:
    log_depth = torch.tensor([[-60.0, 60.0], [60.0, -60.0]]).repeat(8, 8)
    found = shrunk(log_depth, torch.full_like(log_depth, uncertainty), OUT)
    assert bool(found.isfinite().all()) and float(found.abs().max()) <= 60.0001
