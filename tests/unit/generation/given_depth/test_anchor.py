"""Depth of every kind in scene units; the missing offset of inverse depth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import InputError
from diff4splat.generation.given_depth.anchor import FARTHEST, NEAREST, anchor
from diff4splat.generation.given_depth.holes import fill_holes
from diff4splat.generation.given_depth.offset import find_offset, is_sky
from diff4splat.models.depth_priors.kinds import KINDS

SIDE = 96
TANGENTS = ((np.arange(SIDE) + 0.5 - SIDE / 2) / SIDE,) * 2
X, Y = np.meshgrid(*TANGENTS)
RAY = np.sqrt(1 + X**2 + Y**2)


def room(turn_deg: float = 20.0) -> np.ndarray:
    """Depth z inside a box, seen at an angle: walls, floor and ceiling, all perpendicular."""
    angle = np.radians(turn_deg)
    c, s, pitch = np.cos(angle), np.sin(angle), np.radians(12)
    direction = np.stack([X, np.cos(pitch) * Y - np.sin(pitch), np.sin(pitch) * Y + np.cos(pitch)])
    a, b, d = c * direction[0] + s * direction[2], direction[1], c * direction[2] - s * direction[0]
    with np.errstate(divide="ignore"):
        hits = [np.where(p > 0, h / p, np.inf) for p, h in
                ((a, 2.0), (-a, 2.2), (b, 1.5), (-b, 1.2), (d, 5.0))]  # fmt: skip
    return np.min(hits, axis=0)


def landscape() -> np.ndarray:
    """Ground that goes to the horizon below a sky; infinity in the sky."""
    with np.errstate(divide="ignore"):
        return np.where(Y > 0.02, 1 / np.maximum(Y, 1e-9), np.inf)


def in_units(z: np.ndarray) -> np.ndarray:
    return np.clip(z * (4 / np.median(z[np.isfinite(z)])), NEAREST, FARTHEST)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_gives_the_same_depth(kind: str) -> None:
    z = room()
    values = {
        "metric": z, "millimetres": 1000 * z, "relative": 0.3 * z, "distance": z * RAY,
        "disparity": 7 / z, "inverse": 0.4 + 7 / z,
    }[kind]  # fmt: skip
    found = anchor(values, kind, TANGENTS)
    tolerance = 0.03 if kind == "inverse" else 1e-4
    assert np.abs(np.log(found.depth / in_units(z))).max() < tolerance
    metres = found.metres_per_unit
    has_unit = kind in ("metric", "millimetres", "distance")
    assert metres == (pytest.approx(np.median(z) / 4, rel=1e-4) if has_unit else None)


@settings(max_examples=4, deadline=None)
@given(
    factor=st.floats(1e-3, 1e3), offset=st.floats(-2, 2), turn_deg=st.floats(15, 30),
    bits=st.sampled_from([None, 8, 16]),
)  # fmt: skip
def test_right_angles_undo_any_affine_change(
    factor: float, offset: float, turn_deg: float, bits: int | None
) -> None:
    z = room(turn_deg)
    values = factor * (1 / z + offset / z.mean())
    if bits is not None:
        values = np.round((values - values.min()) / np.ptp(values) * (2**bits - 1))
    found = anchor(values, "inverse", TANGENTS)
    assert found.offset.why in ("right angles", "shapes of surfaces")
    assert np.abs(np.log(found.depth / in_units(z))).mean() < 0.12


@pytest.mark.parametrize("bits", [None, 8])
def test_sky_is_infinitely_far(bits: int | None) -> None:
    z = landscape()
    values = 3 / z + 5
    if bits is not None:
        values = np.round((values - values.min()) / np.ptp(values) * (2**bits - 1))
    found = anchor(values, "inverse", TANGENTS)
    assert found.offset.why == "sky is infinitely far"
    assert (found.depth[z == np.inf] == FARTHEST).all()
    near = Y > 0.1
    assert np.abs(np.log(found.depth / in_units(z)))[near].max() < 0.05


def test_a_wall_that_is_almost_from_the_front_is_no_sky() -> None:
    wall = np.round(255 * (0.02 * (X + 0.5) + (Y > 0.3) * (Y + 0.3)))
    assert not is_sky(wall)


def test_without_angles_the_spread_is_usual() -> None:
    bumps = 1 + 0.3 * np.sin(5 * X) * np.cos(4 * Y)
    offset = find_offset(bumps + 10, TANGENTS)
    known = bumps + 10 - offset.infinity
    assert 0.2 < known.std() / known.mean() < 1.2


@pytest.mark.parametrize("kind", ["metric", "relative", "disparity", "inverse"])
@pytest.mark.parametrize("value", [0.0, 3.0, np.nan, np.inf])
def test_maps_without_depth_are_refused(kind: str, value: float) -> None:
    with pytest.raises(InputError, match="depth map: expected"):
        anchor(np.full((SIDE, SIDE), value), kind, TANGENTS)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000), kind=st.sampled_from(sorted(KINDS)),
    power=st.floats(-20, 20), spoiled=st.floats(0, 0.9),
)  # fmt: skip
def test_depth_is_finite_and_within_its_range(
    seed: int, kind: str, power: float, spoiled: float
) -> None:
    rng = np.random.default_rng(seed)
    values = rng.uniform(0, 1, (24, 24)) * 10.0**power
    values[rng.random((24, 24)) < spoiled / 2] = np.nan
    values[rng.random((24, 24)) < spoiled / 4] = np.inf
    found = anchor(values, kind, (TANGENTS[0][:24], TANGENTS[1][:24])).depth
    assert np.isfinite(found).all()
    assert found.min() >= NEAREST * 0.999 and found.max() <= FARTHEST * 1.001


def test_holes_take_the_nearest_depth_and_sky_is_far() -> None:
    depth = np.ones((20, 20), np.float32)
    depth[10:] = 2
    depth[:4] = np.nan
    depth[12:14, 5:8] = np.nan
    depth[8, 3] = np.inf
    filled = fill_holes(depth, 50.0)
    assert (filled[:4] == 50).all() and (filled[12:14, 5:8] == 2).all() and filled[8, 3] == 50
    assert (filled[4:8] == 1).all()
