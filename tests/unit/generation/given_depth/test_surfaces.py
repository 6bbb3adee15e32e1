"""Spheres, cylinders and boxes give the offset of inverse depth away."""

import numpy as np
import pytest

from diff4splat.generation.given_depth.anchor import anchor
from diff4splat.generation.given_depth.offset import find_offset
from diff4splat.generation.given_depth.surfaces.evidence import plane_evidence, surface_evidence
from diff4splat.generation.given_depth.surfaces.points import Points, grid_points
from diff4splat.generation.given_depth.surfaces.round import cylinder_errors, sphere_errors
from diff4splat.generation.given_depth.surfaces.segments import covered_share, find_segments

SIDE = 172
TANGENTS = ((np.arange(SIDE) + 0.5 - SIDE / 2) / SIDE,) * 2
X, Y = np.meshgrid(*TANGENTS)
RAYS = np.stack([X, Y, np.ones_like(X)])
WALL = 1 / (0.2 * X + 0.1 * Y + 0.17)
OFFSETS = np.linspace(-0.2, 0.14, 35)
"""0 is the truth, the 21st but one."""
TRUE = int(np.abs(OFFSETS).argmin())


def sphere(center: tuple[float, float, float], radius: float) -> np.ndarray:
    """Depth z; infinite beside it."""
    c = np.array(center)
    a, b = (RAYS**2).sum(0), np.einsum("i,ihw->hw", c, RAYS)
    root = b**2 - a * (c @ c - radius**2)
    with np.errstate(invalid="ignore"):
        return np.where(root > 0, (b - np.sqrt(root)) / a, np.inf)


def cylinder(center: tuple[float, float, float], radius: float) -> np.ndarray:
    """An endless one, whose axis leans."""
    axis = np.array([0.3, 0.8, 0.52]) / np.linalg.norm([0.3, 0.8, 0.52])
    flat = np.eye(3) - np.outer(axis, axis)
    d, c = np.einsum("ij,jhw->ihw", flat, RAYS), flat @ np.array(center)
    a, b = (d**2).sum(0), np.einsum("i,ihw->hw", c, d)
    root = b**2 - a * (c @ c - radius**2)
    with np.errstate(invalid="ignore"):
        return np.where(root > 0, (b - np.sqrt(root)) / a, np.inf)


def points_of(z: np.ndarray, sigma: float = 1e-5) -> Points:
    """Those of a surface, with the noise that they claim."""
    inside = np.isfinite(z)
    u = np.where(inside, 1 / z, np.nan)
    slopes = [np.gradient(u, axis=axis) * SIDE for axis in (1, 0)]
    u = u + sigma * np.random.default_rng(0).normal(size=u.shape)
    grid = Points(x=X, y=Y, value=u, sigma=np.full_like(u, sigma), slope_x=slopes[0],
                  slope_y=slopes[1])  # fmt: skip
    return grid.at(grid.known)


@pytest.mark.parametrize(
    ("errors", "z"),
    [(sphere_errors, sphere((0.2, -0.1, 3.0), 0.7)), (cylinder_errors, cylinder((0, 0, 3), 0.5))],
)
def test_only_the_true_offset_is_round(errors, z: np.ndarray) -> None:
    found = errors(points_of(z).thinned(400), OFFSETS)
    assert found.argmin() == TRUE and found[TRUE] < 1.2
    assert np.delete(found, TRUE).min() > 3


def test_a_sphere_is_no_cylinder_and_the_other_way_round() -> None:
    ball = points_of(sphere((0.2, -0.1, 3.0), 0.7)).thinned(400)
    assert cylinder_errors(ball, OFFSETS).min() > 3
    pipe = points_of(cylinder((0, 0, 3), 0.5)).thinned(400)
    assert sphere_errors(pipe, OFFSETS).min() > 3


def test_planes_that_meet_at_right_angles_peak_at_the_true_offset() -> None:
    one, other = np.array([0.6, 0.0, 0.8]), np.array([-0.8, 0.0, 0.6])
    inverse = np.maximum(*(np.einsum("i,ihw->hw", n, RAYS) / 3 for n in (one, other)))
    grid = grid_points(inverse, TANGENTS)
    left = np.einsum("i,ihw->hw", one - other, RAYS) > 0
    found = plane_evidence(grid, [left & grid.known, ~left & grid.known], OFFSETS)
    assert found.argmax() == TRUE and found[TRUE] > 3
    # One plane has no angles.
    assert (plane_evidence(grid, [left & grid.known], OFFSETS) == 0).all()


def test_surfaces_are_found_whole() -> None:
    ball = sphere((0.2, -0.1, 3.0), 0.7)
    grid = grid_points(1 / np.minimum(WALL, ball), TANGENTS)
    segments = find_segments(grid)
    assert covered_share(grid, segments) > 0.9
    (curved,) = (one.mask for one in segments if not one.is_plane)
    inside = ball < WALL
    assert curved[inside & grid.known].mean() > 0.9 and not curved[~inside].any()


@pytest.mark.parametrize(
    ("factor", "offset", "bits", "is_ball"),
    [(1e-3, 2.0, None, True), (300.0, -2.0, 16, True), (1.0, 0.3, 16, False)],
)
def test_one_round_object_before_a_wall_undoes_any_affine_change(
    factor: float, offset: float, bits: int | None, is_ball: bool
) -> None:
    thing = sphere((0.2, 0.1, 3.0), 0.8) if is_ball else cylinder((0.1, 0, 3), 0.6)
    z = np.minimum(WALL, thing)
    values = factor * (1 / z + offset)
    if bits is not None:
        values = np.round((values - values.min()) / np.ptp(values) * (2**bits - 1))
    found = anchor(values, "inverse", TANGENTS)
    assert found.offset.why == "shapes of surfaces"
    assert np.abs(4 / found.depth - np.median(z) / z).max() < 0.03


def test_imprecise_maps_are_not_taken_by_their_word() -> None:
    rng = np.random.default_rng(0)
    bumps = np.kron(rng.normal(size=(12, 12)), np.ones((15, 15)))[:SIDE, :SIDE]
    smooth = np.real(np.fft.ifft2(np.fft.fft2(bumps) * np.exp(-np.hypot(*np.meshgrid(
        *(np.fft.fftfreq(SIDE),) * 2)) ** 2 * 4000)))  # fmt: skip
    z = np.minimum(WALL, sphere((0.2, -0.1, 3.0), 0.7)) * (1 + 0.05 * smooth)
    assert find_offset(1 / z, TANGENTS).why != "shapes of surfaces"


@pytest.mark.parametrize("value", [np.nan, 0.5])
def test_without_surfaces_nothing_is_said(value: float) -> None:
    grid = grid_points(np.full((40, 40), value), (TANGENTS[0][:40], TANGENTS[1][:40]))
    segments = find_segments(grid)
    evidence = surface_evidence(grid, segments, OFFSETS)
    assert np.isfinite(evidence).all() and np.abs(evidence).max() < 0.1
