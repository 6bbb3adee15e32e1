import pytest
import torch
from torch import Tensor

from diff4splat.render.tiling import batches, grid_size, regions, tile_boxes

GRID = (5, 7)
PADDING = 60


def random_boxes(count: int = PADDING) -> Tensor:
    """Boxes of tiles, some of them empty."""
    start = torch.stack([torch.randint(0, 7, (count,)), torch.randint(0, 5, (count,))], 1)
    stop = torch.minimum(start + torch.randint(0, 4, (count, 2)), torch.tensor([7, 5]))
    return torch.cat([start, stop], 1)


def lists_by_loop(boxes: Tensor) -> dict[int, list[int]]:
    """Gaussians per tile, by asking every tile for every box."""
    lists = {}
    for row in range(GRID[0]):
        for column in range(GRID[1]):
            inside = [
                index
                for index, (left, top, right, bottom) in enumerate(boxes.tolist())
                if left <= column < right and top <= row < bottom
            ]
            if inside:
                lists[row * GRID[1] + column] = inside
    return lists


@pytest.mark.parametrize("limit", [1, 10, 100, 10**6])
@pytest.mark.parametrize("batch_pairs", [1, 30, 10**6])
def test_every_tile_gets_its_list(limit: int, batch_pairs: int) -> None:
    boxes, lists = random_boxes(), {}
    for region in regions(boxes, GRID, limit):
        for batch in batches(boxes, region, GRID[1], batch_pairs):
            assert batch.members.numel() <= batch_pairs or len(batch.tiles) == 1
            for tile, members in zip(batch.tiles.tolist(), batch.members.tolist(), strict=True):
                assert tile not in lists
                lists[tile] = [member for member in members if member != PADDING]
                assert members == lists[tile] + [PADDING] * (len(members) - len(lists[tile]))
    assert lists == lists_by_loop(boxes)


@pytest.mark.parametrize("limit", [1, 10, 100, 10**6])
def test_regions_cover_the_grid_once_within_the_limit(limit: int) -> None:
    boxes, covered = random_boxes(), torch.zeros(GRID, dtype=torch.long)
    lengths = {tile: len(members) for tile, members in lists_by_loop(boxes).items()}
    for left, top, right, bottom in regions(boxes, GRID, limit):
        covered[top:bottom, left:right] += 1
        tiles = [r * GRID[1] + c for r in range(top, bottom) for c in range(left, right)]
        assert len(tiles) == 1 or sum(lengths.get(tile, 0) for tile in tiles) <= limit
    assert bool((covered == 1).all())


def test_padding_is_a_small_part() -> None:
    boxes = random_boxes()
    for batch in batches(boxes, (0, 0, GRID[1], GRID[0]), GRID[1], 10**6):
        assert float((batch.members == PADDING).float().mean()) <= 0.25


def test_no_gaussians_make_no_batches() -> None:
    boxes = torch.zeros(0, 4, dtype=torch.long)
    assert regions(boxes, GRID, 10) == [(0, 0, 7, 5)]
    assert batches(boxes, (0, 0, 7, 5), 7, 10) == []


def test_boxes_of_pixels_touch_tiles() -> None:
    boxes = torch.tensor([[0, 0, 8, 9], [7, 8, 9, 16], [3, 3, 3, 3]])
    assert tile_boxes(boxes, 8).tolist()[:2] == [[0, 0, 1, 2], [0, 1, 2, 2]]


def test_partial_tiles_count() -> None:
    assert grid_size((16, 17), 8) == (2, 3)
