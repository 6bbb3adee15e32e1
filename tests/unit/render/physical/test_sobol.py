"""Samples of pixels: nets in every dimension, unlike from pixel to pixel, the same in any batch."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError
from diff4splat.render.physical import sobol
from diff4splat.render.physical.sobol import sample_points

PIXELS = torch.tensor([0, 1, 2, 77, 65535, 1 << 40, -5])


def strata(points: torch.Tensor, parts: int) -> torch.Tensor:
    """Which of equal parts each coordinate falls in."""
    return (points.double() * parts).long()


@pytest.mark.parametrize("bits", [0, 1, 2, 5, 10])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_a_block_has_one_point_in_every_stratum_of_every_dimension(
    bits: int, dtype: torch.dtype
) -> None:
    count = 1 << bits
    for first in (0, count, 5 * count):
        points = sample_points(PIXELS, count, 5, 3, first, dtype)
        found = strata(points, count).sort(1).values
        assert bool((found == torch.arange(count)[None, :, None]).all())


@pytest.mark.parametrize("bits", [1, 4, 7, 10])
def test_the_first_two_dimensions_have_one_point_in_every_elementary_interval(bits: int) -> None:
    count = 1 << bits
    points = sample_points(PIXELS, count, 2, 11, first=3 * count)
    for across in range(bits + 1):
        columns, rows = 1 << across, count >> across
        cell = strata(points[..., 0], columns) * rows + strata(points[..., 1], rows)
        assert bool((cell.sort(1).values == torch.arange(count)).all())


def test_directions_are_those_of_joe_and_kuo() -> None:
    # PyTorch's own sequence goes through the same words in another order.
    count = 256
    want = torch.quasirandom.SobolEngine(5).draw(count, dtype=torch.float64)
    numbers = torch.arange(count)
    mirror = sobol._byte_table(torch.tensor([sobol._mirrored(1 << k) for k in range(32)]))
    axes = []
    for axis in range(5):
        table = sobol._byte_table(sobol._reversed_directions(axis))
        axes.append(sobol._mapped(sobol._mapped(sobol._mapped(numbers, mirror), table), mirror))
    got = torch.stack(axes, 1).double() * 2.0**-32
    assert sorted(map(tuple, got.tolist())) == sorted(map(tuple, want.tolist()))
    # All 32 bits, of which those samples use eight.
    engine = torch.quasirandom.SobolEngine(5).sobolstate.long() << 2
    for axis in range(5):
        words = sobol._mapped(sobol._reversed_directions(axis).flip(0), mirror)
        assert torch.equal(words[:30], engine[axis])


@settings(deadline=None, max_examples=25)
@given(
    pixel=st.integers(-(2**62), 2**62),
    seed=st.integers(0, 2**40),
    first=st.integers(0, 2**20),
    cut=st.integers(1, 12),
    dimensions=st.integers(1, 5),
)
def test_chunks_and_batches_change_no_bit(
    pixel: int, seed: int, first: int, cut: int, dimensions: int
) -> None:
    pixels = torch.tensor([5, pixel, 9])
    whole = sample_points(pixels, 13, 5, seed, first)
    start = sample_points(pixels, cut, dimensions, seed, first)
    rest = sample_points(pixels[1:2], 13 - cut, dimensions, seed, first + cut)
    assert torch.equal(start, whole[:, :cut, :dimensions])
    assert torch.equal(rest, whole[1:2, cut:, :dimensions])


def test_points_lie_below_one_in_every_dtype() -> None:
    pixels = torch.arange(400)
    for dtype in (torch.float32, torch.float64):
        points = sample_points(pixels, 1024, 5, 0, dtype=dtype)
        assert points.dtype == dtype
        assert float(points.min()) >= 0
        assert float(points.max()) < 1


def test_float32_points_are_float64_points_with_fewer_digits() -> None:
    short = sample_points(PIXELS, 64, 5, 2, dtype=torch.float32).double()
    long = sample_points(PIXELS, 64, 5, 2)
    assert torch.equal(short, (long * 2**24).floor() / 2**24)


def test_pixels_seeds_and_dimensions_are_unlike() -> None:
    pixels, samples = torch.arange(4096), 4
    one = sample_points(pixels, samples, 5, 0) - 0.5
    other = sample_points(pixels, samples, 5, 1) - 0.5
    series = torch.cat([one.flatten(1), one.flatten(1).roll(1, 0), other.flatten(1)], 1)
    across = series.unflatten(1, (3, samples, 5))
    # Samples of one pixel shun each other on purpose; means over pixels are independent.
    for k in range(samples):
        table = across[:, :, k].flatten(1).T.corrcoef() - torch.eye(15)
        assert float(table.abs().max()) < 5 / 4096**0.5
    assert not torch.equal(one, other)


def test_every_single_point_is_uniform_over_pixels() -> None:
    points = sample_points(torch.arange(20_000), 2, 5, 4)
    for k in range(2):
        share = torch.stack([torch.bincount(strata(p, 16), minlength=16) for p in points[:, k].T])
        # Chi-squared with 15 degrees of freedom exceeds 50 once in 10⁵.
        assert float(((share - 1250.0) ** 2 / 1250).sum(1).max()) < 50


@pytest.mark.parametrize(("one", "other"), [(0, 1), (0, 2), (1, 3), (2, 5), (0, 7)])
def test_pairs_of_samples_are_uniform_over_their_places(one: int, other: int) -> None:
    # Samples part ways at the first digit in which the shuffled numbers differ.
    points = strata(sample_points(torch.arange(40_000), 8, 1, 0)[..., 0], 8)
    found = torch.bincount(points[:, one] * 8 + points[:, other], minlength=64).view(8, 8).double()
    places = torch.arange(8)
    apart = (places[:, None] ^ places).clamp_min(1).log2().floor()
    assert float(found.diagonal().sum()) == 0
    for level in range(3):
        mask = (apart == level) & (places[:, None] != places)
        if float(found[mask].sum()) > 0:
            mean = found[mask].mean()
            # Chi-squared with at most 31 degrees of freedom exceeds 75 once in 10⁵.
            assert float(((found[mask] - mean) ** 2 / mean).sum()) < 75


def test_dimensions_are_scrambled_apart() -> None:
    points = strata(sample_points(torch.arange(40_000), 2, 5, 0), 4)
    # Which half and quarter the first sample lies in, and which quarter of its half the second.
    own = points[:, 0] * 2 + points[:, 1] % 2
    for axis in range(5):
        for other in range(axis):
            found = torch.bincount(own[:, axis] * 8 + own[:, other], minlength=64).double()
            # Chi-squared with 63 degrees of freedom exceeds 125 once in 10⁵.
            assert float(((found - 625) ** 2 / 625).sum()) < 125


def test_integrals_converge_faster_than_with_random_numbers() -> None:
    def error(count: int) -> float:
        x = sample_points(torch.arange(64), count, 5, 0)
        # Mean 1; variance per random point (4/3)^5... - 1 = 0.76.
        means = (x * 2).mean(-1).exp().mean(1)
        exact = ((torch.e ** (2 / 5) - 1) * 5 / 2) ** 5
        return float((means - exact).square().mean().sqrt())

    assert error(1024) < error(16) / 64**0.9


def test_no_pixels_give_no_points() -> None:
    assert sample_points(torch.zeros(0, dtype=torch.int64), 3, 2, 0).shape == (0, 3, 2)


def test_negative_and_long_seeds_are_seeds_too() -> None:
    made = [sample_points(PIXELS, 4, 2, seed) for seed in (0, -1, 1 << 32, 1, (1 << 32) + 1)]
    for i, one in enumerate(made):
        for other in made[:i]:
            assert not bool((one == other).any())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"samples": 0}, "samples: expected at least 1, got 0"),
        ({"dimensions": 0}, "dimensions: expected 1 to 5, got 0"),
        ({"dimensions": 6}, "dimensions: expected 1 to 5, got 6"),
        ({"first": -1}, "first: expected 0 or more"),
        ({"first": 1 << 32}, "first: expected 0 or more"),
        ({"dtype": torch.float16}, "dtype: expected float32 or float64, got torch.float16"),
    ],
)
@pytest.mark.usefixtures("as_shipped")
def test_what_cannot_be_is_refused(changes: dict, message: str) -> None:
    asked = {"samples": 4, "dimensions": 2, "seed": 0} | changes
    with pytest.raises(ConfigError, match=message):
        sample_points(PIXELS, **asked)
