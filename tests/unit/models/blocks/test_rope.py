import oracles_models as oracle
import pytest
import torch

from diff4splat.models.blocks.rope import axis_widths, rope_tables, rotate

CPU = torch.device("cpu")


@pytest.mark.parametrize(
    ("head", "want"), [(128, (44, 42, 42)), (64, (24, 20, 20)), (6, (2, 2, 2)), (12, (4, 4, 4))]
)
def test_axis_widths_follow_wan(head: int, want: tuple[int, int, int]) -> None:
    assert axis_widths(head) == want


@pytest.mark.parametrize("grid", [(1, 1, 1), (2, 3, 4), (3, 1, 5)])
def test_matches_complex_rotation(grid: tuple[int, int, int]) -> None:
    heads = torch.randn(2, grid[0] * grid[1] * grid[2], 3, 12)
    got = rotate(heads, rope_tables(grid, 12, CPU))
    want = oracle.rotated(heads, grid, axis_widths(12))
    torch.testing.assert_close(got.double(), want, atol=2e-6, rtol=0)


def test_products_depend_on_differences_of_positions_only() -> None:
    grid = (4, 5, 6)
    query, key = (
        torch.randn(1, 1, 1, 24).expand(1, 120, 1, 24),
        torch.randn(1, 1, 1, 24).expand(1, 120, 1, 24),
    )
    tables = rope_tables(grid, 24, CPU)
    turned_query = rotate(query, tables).reshape(*grid, 24)
    turned_key = rotate(key, tables).reshape(*grid, 24)
    first = (turned_query[0, 1, 2] * turned_key[1, 3, 3]).sum()
    moved = (turned_query[2, 2, 4] * turned_key[3, 4, 5]).sum()
    other = (turned_query[2, 2, 4] * turned_key[3, 4, 4]).sum()
    torch.testing.assert_close(first, moved, atol=1e-5, rtol=0)
    assert abs(first - other) > 1e-3


def test_length_is_kept() -> None:
    heads = torch.randn(1, 24, 2, 12)
    turned = rotate(heads, rope_tables((2, 3, 4), 12, CPU))
    torch.testing.assert_close(turned.norm(dim=-1), heads.norm(dim=-1))


def test_tables_stay_in_full_precision_under_autocast() -> None:
    with torch.autocast("cpu", torch.bfloat16):
        tables = rope_tables((50, 2, 2), 12, CPU)
    assert tables.cos.dtype == torch.float32
    torch.testing.assert_close(tables.cos, rope_tables((50, 2, 2), 12, CPU).cos, atol=0, rtol=0)


def test_gradcheck() -> None:
    tables = rope_tables((1, 2, 2), 6, CPU)
    heads = torch.randn(1, 4, 1, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: rotate(x, tables), heads)
