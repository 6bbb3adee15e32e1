"""Flow of what moves far, and of what does not move."""

import pytest
import torch
from torch import Tensor

from diff4splat.models.ldrm.optical_flow.lucas_kanade import track_flow
from diff4splat.models.ldrm.optical_flow.optical_flow import optical_flow

OBJECT = (slice(20, 36), slice(10, 26))
WITHIN = (0, slice(None), slice(23, 33), slice(13, 23))


def images(right: int, down: int) -> tuple[Tensor, Tensor]:
    """An object before a background, displaced in the second image."""
    coarse = torch.rand(2, 3, 16, 16, generator=torch.Generator().manual_seed(5))
    background, item = torch.nn.functional.interpolate(coarse, scale_factor=4, mode="bicubic")
    source, target = (background.clamp(0, 1).clone() for _ in range(2))
    rows, columns = OBJECT
    there = (slice(rows.start + down, rows.stop + down), slice(10 + right, 26 + right))
    source[:, rows, columns] = item[:, rows, columns].clamp(0, 1)
    target[:, there[0], there[1]] = source[:, rows, columns]
    return source[None], target[None]


def error(flow: Tensor, right: int, down: int) -> float:
    """Median over the object."""
    want = torch.tensor([float(right), float(down)])[:, None, None]
    return float((flow[WITHIN] - want).norm(dim=0).median())


@pytest.mark.parametrize(("right", "down"), [(14, 0), (0, -13), (12, 12)])
def test_far_objects_are_found_by_blocks_alone(right: int, down: int) -> None:
    source, target = images(right, down)
    start = torch.zeros(1, 2, 64, 64)
    assert error(track_flow(source, target, start), right, down) > 4
    assert error(optical_flow(source, target, start), right, down) < 0.75


def test_the_background_stays() -> None:
    source, target = images(14, 0)
    flow = optical_flow(source, target, torch.zeros(1, 2, 64, 64))
    assert float(flow[..., 44:, :].norm(dim=1).max()) < 0.5
    assert float(flow[..., :14, :].norm(dim=1).max()) < 0.5
    beside = flow[..., 22:34, 2:7].norm(dim=1)
    assert float(beside.max()) < 0.5


def test_without_a_match_gradients_decide() -> None:
    source, _ = images(0, 0)
    start = torch.full((1, 2, 64, 64), 0.5)
    flow = optical_flow(source, source, start)
    assert torch.equal(flow, track_flow(source, source, start))
