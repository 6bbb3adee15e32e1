"""Hits of a ray in order, whatever order they come in."""

from itertools import product

import numpy as np
import pytest
from numba import njit

from diff4splat.kernels.addresses import address
from diff4splat.render.trace.traversal.hits import sort_hits
from diff4splat.render.trace.traversal.intersect import ScratchAddresses


@njit
def put_first_ray_in_order(distances, alphas, ranks, members, counts, dark):
    at = ScratchAddresses(
        0, 0, 0, 0, address(members), 0, address(distances), address(alphas), address(ranks),
        address(counts), 0, 0, 0, len(distances),
    )  # fmt: skip
    sort_hits(at, 0, dark)


def unordered(kind: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Distances, some of them equal, and indices."""
    generator = np.random.default_rng(count)
    distances = np.sort(generator.random(count).astype(np.float32))
    distances[1::3] = distances[: count - 1 : 3][: len(distances[1::3])]
    if kind == "nearly":
        distances[::5] += np.float32(1e-3)
    if kind == "backwards":
        distances = distances[::-1].copy()
    if kind == "anyhow":
        generator.shuffle(distances)
    if kind == "all at once":
        distances[:] = 1.0
    return distances, generator.permutation(count).astype(np.int32)


@pytest.mark.parametrize("kind", ["in order", "nearly", "backwards", "anyhow", "all at once"])
def test_by_distance_then_by_index_until_the_light_is_gone(kind: str) -> None:
    for count, alpha in product([0, 1, 2, 3, 17, 4000], [0.0, 0.01, 0.9]):
        assert_in_order(kind, count, alpha)


def assert_in_order(kind: str, count: int, alpha: float) -> None:
    distances, members = unordered(kind, count)
    alphas, dark = np.full(count, alpha, np.float32), 1e-3
    moved = distances.copy(), alphas, np.arange(count, dtype=np.int32)
    counts = np.array([count], np.int64)
    put_first_ray_in_order(*moved, members, counts, dark)
    light = np.cumprod(np.append(1.0, 1 - alphas.astype(np.float64)))[:-1]
    want = np.lexsort((members, distances))[light >= dark]
    assert counts[0] == len(want)
    assert np.array_equal(moved[0][: len(want)], distances[want])
    assert np.array_equal(moved[2][: len(want)], want)
    assert sorted(moved[2].tolist()) == list(range(count))
