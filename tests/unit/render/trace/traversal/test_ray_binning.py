"""Packets of rays that start in many places: narrow, whole and the same every time."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.render.trace.jit import GROUP
from diff4splat.render.trace.tables import Floats, RayBundle
from diff4splat.render.trace.traversal.packets import bundle_rays
from diff4splat.render.trace.traversal.ray_binning import choose_bins

NONE = np.empty(0, np.float32)
DISTANCE, SIZE = 3.0, 250.0
"""Of a room; one speck far away makes the whole large."""


@pytest.fixture(autouse=True, scope="module")
def _compiled() -> None:
    GROUP.ensure_compiled()


def turn(seed: int) -> np.ndarray:
    """A rotation."""
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


def looks(side: int, samples: int) -> np.ndarray:
    """Unit directions through a square image, ``samples`` of each."""
    edge = (np.arange(side) + 0.5) / side - 0.5
    x, y = (part.reshape(-1, 1).repeat(samples, 1).ravel() for part in np.meshgrid(edge, edge))
    ways = np.stack([x, y, np.ones_like(x)], 1)
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def through_lens(side: int, samples: int, radius: float, axes: np.ndarray) -> tuple[Floats, Floats]:
    """Origins all over a disc, and directions to what is in focus."""
    ways = looks(side, samples)
    generator = np.random.default_rng(0)
    angle = generator.uniform(0, 2 * np.pi, len(ways))
    share = radius * np.sqrt(generator.uniform(0, 1, len(ways)))
    starts = np.stack([share * np.cos(angle), share * np.sin(angle), 0 * angle], 1)
    ahead = ways * DISTANCE / ways[:, 2:] - starts
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return (starts @ axes.T).astype(np.float32), (ahead @ axes.T).astype(np.float32)


def along_path(side: int, samples: int, length: float, rolls: bool) -> tuple[Floats, Floats]:
    """Origins along a line: by row where the shutter rolls, else anywhere."""
    ways = looks(side, samples)
    share = np.random.default_rng(0).uniform(0, 1, len(ways))
    if rolls:
        share = np.arange(len(ways)) // (side * samples) / side
    starts = share[:, None] * np.array([0.6, 0.0, 0.8]) * length
    return starts.astype(np.float32), ways.astype(np.float32)


def packets(made: RayBundle) -> list[np.ndarray]:
    """Indices of the rays of each packet."""
    return [
        made.order[first:last]
        for first, last in zip(made.starts[:-1], made.starts[1:], strict=True)
    ]


def width(made: RayBundle, groups: list[np.ndarray]) -> float:
    """The median of how far rays of a packet are apart at most, between half and twice as far."""
    spans = []
    for own in groups:
        for depth in (0.5 * DISTANCE, DISTANCE, 2 * DISTANCE):
            points = made.origins[own] + depth * made.directions[own]
            spans.append(np.linalg.norm(points.max(0) - points.min(0)))
    return float(np.median(spans))


def by_direction(rays: tuple[Floats, Floats]) -> list[np.ndarray]:
    """The packets of rays as if all began at one place."""
    origins, directions = rays
    return packets(bundle_rays(0 * origins, directions, NONE, SIZE, DISTANCE))


@pytest.mark.parametrize("seed", [0, 1])
def test_packets_through_a_lens_are_narrower_than_by_direction_alone(seed: int) -> None:
    rays = through_lens(48, 64, 0.15, turn(seed))
    made = bundle_rays(*rays, NONE, SIZE, DISTANCE)
    assert width(made, packets(made)) < 0.85 * width(made, by_direction(rays))
    assert len(made.starts) - 1 < 1.1 * len(made.order) / 64


def test_packets_along_a_path_are_narrower_than_by_direction_alone() -> None:
    rays = along_path(96, 16, 0.6, rolls=False)
    made = bundle_rays(*rays, NONE, SIZE, DISTANCE)
    assert width(made, packets(made)) < 0.75 * width(made, by_direction(rays))


def test_a_lens_in_any_pose_is_cut_across_and_not_along() -> None:
    for seed in range(3):
        rays = through_lens(48, 64, 0.15, turn(seed))
        counts = choose_bins(*rays, SIZE, DISTANCE).counts.tolist()
        assert counts[0] == 1
        assert counts[1] >= 2
        assert counts[2] >= 2


def test_rays_of_a_pinhole_and_of_a_rolling_shutter_share_one_cell() -> None:
    pinhole = looks(64, 1).astype(np.float32)
    noise = 1e-6 * np.random.default_rng(0).normal(size=pinhole.shape).astype(np.float32)
    assert choose_bins(noise, pinhole, SIZE, DISTANCE).counts.tolist() == [1, 1, 1]
    rolling = along_path(128, 1, 0.3, rolls=True)
    assert choose_bins(*rolling, SIZE, DISTANCE).counts.tolist() == [1, 1, 1]


def test_rays_of_two_pinholes_do_not_share_packets() -> None:
    ways = np.tile(looks(64, 1), (2, 1)).astype(np.float32)
    starts = np.repeat(np.array([[0, 0, 0], [1, 2, 0]], np.float32), 64 * 64, 0)
    made = bundle_rays(starts, ways, NONE, SIZE, DISTANCE)
    mixed = [own for own in packets(made) if len(np.unique(own // 4096)) > 1]
    assert len(mixed) <= 1


@given(
    count=st.sampled_from([1, 2, 63, 65, 700]),
    spread=st.sampled_from([0.0, 1e-20, 1e-3, 1.0, 1e3, 1e18]),
    around=st.booleans(),
    seed=st.integers(0, 100),
)
@settings(max_examples=40, deadline=None)
def test_every_ray_is_in_one_packet_that_looks_one_way(
    count: int, spread: float, around: bool, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    origins = (spread * generator.normal(size=(count, 3))).astype(np.float32)
    ways = generator.normal(size=(count, 3)) + (0.0 if around else np.array([0.0, 0.0, 30.0]))
    ways = (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)
    made = bundle_rays(origins, ways, NONE, 10.0, DISTANCE)
    assert sorted(made.order.tolist()) == list(range(count))
    groups = packets(made)
    assert sum(map(len, groups)) == count
    for own in groups:
        assert 1 <= len(own) <= 64
        assert (ways[own] @ ways[own[0]]).min() >= 0.9 - 1e-5
        away = np.linalg.norm((origins[own] - origins[own[0]]).astype(np.float64), axis=1)
        assert away.max() <= 10.0 / 8 * (1 + 1e-5)


def test_packets_are_the_same_every_time_and_for_any_threads() -> None:
    rays = through_lens(48, 64, 0.15, turn(0))
    before = torch.get_num_threads()
    try:
        made = []
        for threads in (1, 4):
            torch.set_num_threads(threads)
            made.append(bundle_rays(*rays, NONE, SIZE, DISTANCE))
    finally:
        torch.set_num_threads(before)
    assert np.array_equal(made[0].order, made[1].order)
    assert np.array_equal(made[0].starts, made[1].starts)


def test_no_rays_make_no_packets() -> None:
    none = np.empty((0, 3), np.float32)
    made = bundle_rays(none, none, NONE, SIZE, DISTANCE)
    assert made.starts.tolist() == [0]
