"""Depths that camera presets are measured in."""

import pytest
import torch

from diff4splat.scene.extent import DEFAULT_DEPTH, DepthRange, depth_quantiles


@pytest.mark.parametrize("unit", [1e-30, 1.0, 1e30])
def test_quantiles_of_depths_in_any_order(unit: float) -> None:
    depths = unit * torch.arange(1.0, 102.0)[torch.randperm(101)]
    found = depth_quantiles(depths)
    for name, want in (("near", 6.0), ("focus", 26.0), ("far", 96.0)):
        assert getattr(found, name) == pytest.approx(want * unit), name


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_depths(count: int) -> None:
    found = depth_quantiles(torch.full((count,), 7.0))
    assert found == DepthRange(near=7.0, focus=7.0, far=7.0)


def test_no_depth_has_a_default() -> None:
    found = depth_quantiles(torch.zeros(0))
    assert found == DepthRange(near=DEFAULT_DEPTH, focus=DEFAULT_DEPTH, far=DEFAULT_DEPTH)
