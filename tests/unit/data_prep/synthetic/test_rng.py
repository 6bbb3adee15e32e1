import numpy as np
import pytest

from diff4splat.data_prep.synthetic.quantise import quantise, quantise_number
from diff4splat.data_prep.synthetic.rng import Rng


def test_the_same_path_gives_the_same_numbers_for_ever() -> None:
    rng = Rng("world", 7)
    assert [rng.random_seed() for _ in range(3)] == [2418646704, 556285645, 2830841875]


def test_children_do_not_depend_on_what_was_drawn_before() -> None:
    fresh, used = Rng(1), Rng(1)
    used.unit(100)
    assert fresh.child("a").random_seed() == used.child("a").random_seed()
    assert fresh.child("a").random_seed() != fresh.child("b").random_seed()


def test_uniform_and_normal_moments() -> None:
    unit, normal = Rng("u").unit(20000), Rng("n").normal(20000)
    assert unit.min() >= 0 and unit.max() < 1
    assert unit.mean() == pytest.approx(0.5, abs=0.01)
    assert unit.var() == pytest.approx(1 / 12, abs=0.002)
    assert normal.mean() == pytest.approx(0, abs=0.03)
    assert normal.std() == pytest.approx(1, abs=0.02)
    assert np.abs(normal).max() <= 6


def test_integers_reach_both_ends_and_weights_count() -> None:
    rng = Rng("i")
    assert {rng.integer(2, 4) for _ in range(100)} == {2, 3, 4}
    chosen = [rng.weighted_choice("ab", (0.0, 1.0)) for _ in range(20)]
    assert set(chosen) == {"b"}
    assert sorted(rng.permuted([1, 2, 3])) == [1, 2, 3]
    assert {rng.sign() for _ in range(30)} == {-1.0, 1.0}


def test_the_grid_swallows_last_bits_and_negative_zeros() -> None:
    value = np.array([0.1, -1e-17, 1.0 / 3])
    nudged = value * (1 + 1e-15)
    assert quantise(value).tobytes() == quantise(nudged).tobytes()
    assert not np.signbit(quantise(value)[1])
    assert np.abs(quantise(value) - value).max() <= 2.0**-15
    assert quantise_number(0.30001, 2) == 0.25


def test_log_uniform_numbers_have_a_uniform_logarithm() -> None:
    stream = Rng("log uniform")
    values = np.array([stream.log_uniform(0.01, 100.0) for _ in range(4000)])
    assert values.min() >= 0.01 and values.max() < 100.0
    shares = np.histogram(np.log10(values), bins=4, range=(-2, 2))[0] / len(values)
    np.testing.assert_allclose(shares, 0.25, atol=0.03)
