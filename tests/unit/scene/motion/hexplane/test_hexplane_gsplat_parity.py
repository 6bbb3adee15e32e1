"""Features, gradients and penalties against gsplat's own HexPlane field at equal planes.

Its files are loaded by themselves, because the package wants CUDA kernels and they do not.
"""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import torch
from oracles_hexplane import random_planes, random_points, with_levels

from diff4splat.scene.motion.hexplane.planes import HexPlanes, HexPlaneSize
from diff4splat.scene.motion.hexplane.regularisers import penalties

BOUNDS = 1.6
BOX = torch.tensor([[BOUNDS] * 3, [-BOUNDS] * 3])
"""First and last node: flipped, as there."""
LARGEST_DIFFERENCE = 1e-5


def contributed(name: str) -> ModuleType:
    spec = importlib.util.find_spec("gsplat")
    folders = list(spec.submodule_search_locations or []) if spec else []
    files = [Path(folder) / "contrib" / "dynamic" / f"{name}.py" for folder in folders]
    found = [file for file in files if file.is_file()]
    if not found:
        pytest.skip("needs gsplat 1.6 or newer with contrib/dynamic, found none")
    loaded = importlib.util.spec_from_file_location(f"gsplat_{name}", found[0])
    module = importlib.util.module_from_spec(loaded)
    loaded.loader.exec_module(module)
    return module


def theirs_with(planes: HexPlanes, size: HexPlaneSize) -> torch.nn.Module:
    config = {
        "grid_dimensions": 2,
        "input_coordinate_dim": 4,
        "output_coordinate_dim": size.channels,
        "resolution": [*size.space, size.time],
    }
    field = contributed("hexplane").HexPlaneField(BOUNDS, config, size.multipliers)
    for grids, level in zip(field.grids, planes.levels, strict=True):
        for grid, plane in zip(grids, level, strict=True):
            grid.data.copy_(plane.permute(2, 0, 1)[None])
    return field


def largest(ours: torch.Tensor, theirs: torch.Tensor) -> float:
    """Relative to the largest number."""
    return float(((ours - theirs).abs().max() / theirs.abs().max()).detach())


def test_features_and_gradients(record_property: Callable[[str, object], None]) -> None:
    size = HexPlaneSize(space=(9, 8, 7), time=6, channels=16, multipliers=(1, 2))
    drawn = random_planes(size, torch.float32, BOX, "half")
    field = theirs_with(drawn, size)
    levels = [[plane.requires_grad_() for plane in level] for level in drawn.levels]
    points = random_points(500, torch.float32, BOX).requires_grad_()
    part = 0.37
    ours = with_levels(drawn, levels).features(points, 1.0 + 2.0 * part)
    theirs = field(torch.cat([points, torch.full((500, 1), part)], 1))
    seed = torch.randn_like(theirs)
    flat = [plane for level in levels for plane in level]
    got = torch.autograd.grad(ours, [points, *flat], seed)
    wanted = [points, *(grid for grids in field.grids for grid in grids)]
    want = list(torch.autograd.grad(theirs, wanted, seed))
    want[1:] = [gradient[0].permute(1, 2, 0) for gradient in want[1:]]
    differences = [largest(ours, theirs), *map(largest, got, want)]
    record_property("largest_difference", max(differences))
    assert max(differences) <= LARGEST_DIFFERENCE


def test_penalties() -> None:
    size = HexPlaneSize(space=(9, 8, 7), time=6, channels=4, multipliers=(1, 2))
    planes = random_planes(size, torch.float32, BOX)
    field, rules = theirs_with(planes, size), contributed("regulation")
    ours = penalties(planes)
    want = (
        rules.plane_smoothness(field.spatial_planes()),
        rules.time_smoothness(field.temporal_planes()),
        rules.time_l1(field.temporal_planes()),
    )
    for got, expected in zip((ours.space, ours.time, ours.static), want, strict=True):
        torch.testing.assert_close(got, expected, rtol=1e-5, atol=0)
