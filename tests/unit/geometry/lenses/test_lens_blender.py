"""Blender's fisheye polynomial: conformance values, signs, field of view."""

import math

import pytest
import torch
from lens_cases import doubles, lens_case
from oracles_lenses import blender_direction, first_fall

from diff4splat.geometry.lenses.blender_fisheye import BLENDER_DEFAULT, BlenderFisheye
from diff4splat.geometry.lenses.build import blender_camera
from diff4splat.geometry.lenses.sensor import sensor_directions

EQUIDISTANT = (0.0, -5.79e-2, 0.0, 0.0, 0.0)
STEREOGRAPHIC = (0.0, -5.79e-2, 0.0, 9.48e-5, -7.67e-6)


def sensor_points(count: int) -> torch.Tensor:
    """Points of the 36 x 41.142857 mm sensor."""
    return (torch.rand(count, 2, dtype=torch.float64) - 0.5) * doubles((36.0, 41.142857))


def test_the_corner_pixel_of_the_4d_grt_example() -> None:
    lens = BlenderFisheye(coefficients=doubles((0.0, math.radians(1), 0.0, 0.0, 0.0)))
    camera = blender_camera((4, 4), sensor_mm=4.0, dtype=torch.float64)
    direction, exists = sensor_directions(camera, lens, doubles((0.5, 0.5)))
    angle = math.radians(math.sqrt(4.5))
    sideways = -math.sin(angle) / math.sqrt(2)
    assert exists
    torch.testing.assert_close(direction, doubles((sideways, sideways, math.cos(angle))))


def test_the_default_is_one_degree_per_millimetre_and_more() -> None:
    published = (0.0, 0.017453292, 5.2359875e-4, 1.7453303e-5, 0.0)
    assert pytest.approx(published, abs=1e-9) == BLENDER_DEFAULT


@pytest.mark.parametrize("k", [EQUIDISTANT, STEREOGRAPHIC])
def test_directions_in_the_signs_of_cycles(k: tuple[float, ...]) -> None:
    lens = BlenderFisheye(coefficients=doubles(k), fov_rad=math.radians(150), cycles_signs=True)
    points = sensor_points(400)
    directions, exists = lens.directions(points)
    theirs = doubles([blender_direction(tuple(p), k, cycles_signs=True) for p in points.tolist()])
    within = theirs[:, 2] >= math.cos(math.radians(75))
    assert torch.equal(exists, within)
    assert 50 < int(exists.sum()) < 400
    torch.testing.assert_close(directions[exists], theirs[exists])
    assert (directions[exists][:, :2] * points[exists]).sum(-1).min() > 0
    back, seen = lens.points(directions[exists])
    assert seen.all()
    torch.testing.assert_close(back, points[exists])


def test_both_signs_describe_the_same_lens() -> None:
    points = sensor_points(50)
    cycles = BlenderFisheye(coefficients=doubles(STEREOGRAPHIC), cycles_signs=True)
    plain = BlenderFisheye(coefficients=-doubles(STEREOGRAPHIC))
    torch.testing.assert_close(cycles.directions(points)[0], plain.directions(points)[0])


def test_the_equidistant_lens_has_radii_proportional_to_angles() -> None:
    lens = BlenderFisheye(coefficients=doubles(EQUIDISTANT), fov_rad=3.0, cycles_signs=True)
    angles = torch.linspace(0.1, 1.49, 20, dtype=torch.float64)
    points, exists = lens.points(
        torch.stack([torch.zeros_like(angles), angles.sin(), angles.cos()], -1)
    )
    assert exists.all()
    torch.testing.assert_close(points[:, 1], angles / 5.79e-2)


def test_a_field_of_view_of_more_than_half_the_sphere() -> None:
    _, lens = lens_case("blender")
    angle = math.radians(130)
    behind = doubles((math.sin(angle), 0.0, math.cos(angle)))
    point, exists = lens.points(behind)
    assert exists
    torch.testing.assert_close(
        doubles(blender_direction(tuple(point.tolist()), lens.coefficients.tolist())), behind
    )
    assert lens.directions(point)[1]
    assert not BlenderFisheye(coefficients=lens.coefficients).points(behind)[1]


def test_a_polynomial_that_folds_back_ends_there() -> None:
    k = (0.0, 0.1, 0.0, -1e-4, 0.0)
    lens = BlenderFisheye(coefficients=doubles(k), fov_rad=2 * math.pi)
    turn = first_fall(lambda r: 0.1 * r - 1e-4 * r**3, 30.0)
    points = doubles(((turn - 0.01, 0.0), (turn + 0.01, 0.0), (-31.0, 0.0)))
    directions, exists = lens.directions(points)
    assert exists.tolist() == [True, False, False]
    back, _ = lens.points(directions[:1])
    torch.testing.assert_close(back, points[:1])
    beyond = math.cos(1.3), math.sin(1.3)  # more than the largest angle of 1.217
    assert not lens.points(doubles((beyond[1], 0.0, beyond[0])))[1]


@pytest.mark.parametrize("k_0", [0.05, -0.05])
def test_a_constant_term_shifts_the_angle(k_0: float) -> None:
    k = (k_0, 0.04, 1e-4, 0.0, 0.0)
    lens = BlenderFisheye(coefficients=doubles(k))
    points = sensor_points(100)
    directions, exists = lens.directions(points)
    theirs = doubles([blender_direction(tuple(p), k) for p in points.tolist()])
    torch.testing.assert_close(directions[exists], theirs[exists])
    outside = torch.linalg.vector_norm(points, dim=-1) > 1.3  # θ > 0
    back, seen = lens.points(directions[exists & outside])
    assert seen.all()
    torch.testing.assert_close(back, points[exists & outside])


def test_with_a_constant_term_centre_and_axis_have_no_partner() -> None:
    lens = BlenderFisheye(coefficients=doubles((-0.05, 0.04, 0.0, 0.0, 0.0)))
    assert not lens.directions(torch.zeros(2, dtype=torch.float64))[1]
    assert not lens.points(doubles((0.0, 0.0, 1.0)))[1]
    shifted = BlenderFisheye(coefficients=doubles((0.05, 0.04, 0.0, 0.0, 0.0)))
    assert not shifted.points(doubles((math.sin(0.04), 0.0, math.cos(0.04))))[1]


def test_using_a_lens_leaves_its_coefficients_alone() -> None:
    coefficients = doubles(BLENDER_DEFAULT)
    lens = BlenderFisheye(coefficients=coefficients)
    lens.directions(sensor_points(3))
    assert torch.equal(coefficients, doubles(BLENDER_DEFAULT))
