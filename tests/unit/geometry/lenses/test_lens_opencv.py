"""The two OpenCV lenses against OpenCV and against their formulas."""

import math

import cv2
import numpy as np
import pytest
import torch
from lens_cases import FISHEYE, RADIAL, TANGENTIAL, THIN_PRISM, doubles, lens_case, pixel_grid
from oracles_lenses import first_fall, fisheye_point, opencv_point
from torch import Tensor

from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.lenses.sensor import sensor_directions, sensor_pixels

K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
IN_OPENCV_ORDER = np.array([*RADIAL[:2], *TANGENTIAL, *RADIAL[2:], *THIN_PRISM])


def directions_in_front(count: int, largest_tangent: float) -> Tensor:
    sideways = (torch.rand(count, 2, dtype=torch.float64) * 2 - 1) * largest_tangent
    return torch.cat([sideways, torch.ones(count, 1, dtype=torch.float64)], -1)


def test_distortion_agrees_with_opencv() -> None:
    camera, lens = lens_case("opencv")
    directions = directions_in_front(500, 0.6)
    pixels, exists = sensor_pixels(camera, lens, directions)
    theirs, _ = cv2.projectPoints(directions.numpy(), np.zeros(3), np.zeros(3), K, IN_OPENCV_ORDER)
    assert exists.all()
    np.testing.assert_allclose(pixels.numpy(), theirs.reshape(-1, 2), atol=1e-9)


def test_distortion_agrees_with_its_formula() -> None:
    _, lens = lens_case("opencv")
    directions = directions_in_front(50, 0.6)
    points, _ = lens.points(directions)
    theirs = [opencv_point(tuple(d), RADIAL, TANGENTIAL, THIN_PRISM) for d in directions.tolist()]
    torch.testing.assert_close(points, doubles(theirs))


def test_undistortion_agrees_with_opencv() -> None:
    camera, lens = lens_case("opencv")
    pixels = pixel_grid()[::20, ::20].reshape(-1, 2)
    directions, exists = sensor_directions(camera, lens, pixels)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    theirs = cv2.undistortPoints(
        pixels.numpy()[:, None], K, IN_OPENCV_ORDER, criteria=stop
    ).reshape(-1, 2)
    assert exists.all()
    tangents = (directions[:, :2] / directions[:, 2:]).numpy()
    np.testing.assert_allclose(tangents, theirs, atol=1e-8)


def test_fisheye_agrees_with_opencv() -> None:
    camera, lens = lens_case("fisheye")
    directions = directions_in_front(500, 3.0)
    pixels, exists = sensor_pixels(camera, lens, directions)
    focal, (centre_x, centre_y) = camera.focal_px.tolist(), camera.center_px.tolist()
    matrix = np.array([[focal[0], 0, centre_x], [0, focal[1], centre_y], [0, 0, 1]])
    theirs, _ = cv2.fisheye.projectPoints(
        directions.numpy()[:, None], np.zeros(3), np.zeros(3), matrix, np.array(FISHEYE)
    )
    assert exists.all()
    np.testing.assert_allclose(pixels.numpy(), theirs.reshape(-1, 2), atol=1e-8)


def test_fisheye_agrees_with_its_formula_behind_the_camera() -> None:
    _, lens = lens_case("fisheye")
    directions = torch.randn(100, 3, dtype=torch.float64)
    points, exists = lens.points(directions)
    theirs = doubles([fisheye_point(tuple(d), FISHEYE) for d in directions.tolist()])
    assert exists.all()
    torch.testing.assert_close(points, theirs)


def test_without_coefficients_the_radius_is_the_angle() -> None:
    lens = OpenCVFisheye(coefficients=torch.zeros(4, dtype=torch.float64))
    angles = torch.linspace(0, math.pi - 1e-3, 50, dtype=torch.float64)
    directions = torch.stack([angles.sin() * 0.6, angles.sin() * -0.8, angles.cos()], -1)
    points, exists = lens.points(directions)
    assert exists.all()
    torch.testing.assert_close(points, angles[:, None] * doubles((0.6, -0.8)))


def test_the_tangent_series_makes_a_fisheye_a_pinhole_near_the_axis() -> None:
    series = OpenCVFisheye(coefficients=doubles((1 / 3, 2 / 15, 17 / 315, 62 / 2835)))
    directions = directions_in_front(200, 0.15)
    points, _ = series.points(directions)
    ideal, _ = Pinhole().points(directions)
    torch.testing.assert_close(points, ideal, atol=1e-8, rtol=0)


def test_without_coefficients_the_opencv_lens_is_a_pinhole() -> None:
    directions = torch.randn(300, 3, dtype=torch.float64)
    points, exists = OpenCVPinhole().points(directions)
    ideal, in_front = Pinhole().points(directions)
    assert torch.equal(exists, in_front)
    assert torch.equal(exists, directions[:, 2] > 0)
    torch.testing.assert_close(points, ideal)
    back, _ = OpenCVPinhole().directions(points)
    torch.testing.assert_close(back, Pinhole().directions(ideal)[0])


@pytest.mark.parametrize("k", [(-0.1, 0, 0, 0), (0.1, -0.05, 0, 0), (0, 0, 0, -1e-4), FISHEYE])
def test_the_fisheye_ends_where_its_polynomial_turns(k: tuple[float, ...]) -> None:
    turn = first_fall(lambda angle: fisheye_point((math.sin(angle), 0, math.cos(angle)), k)[0], 3.1)
    found = OpenCVFisheye(coefficients=doubles(k)).largest_angle_rad
    assert found == pytest.approx(turn if turn < 3.1 else math.pi, abs=1e-4)


@pytest.mark.parametrize(
    "k", [(-0.3, 0, 0, 0, 0, 0), (0, 0, 0, -0.4, 0, 0), (0, 0.1, -0.2, 0, 0, 0)]
)
def test_the_opencv_lens_ends_at_its_turning_point_or_pole(k: tuple[float, ...]) -> None:
    turn = first_fall(lambda x: opencv_point((x, 0, 1), k, (0, 0), (0, 0, 0, 0))[0], 5.0)
    assert turn < 5.0
    lens = OpenCVPinhole(radial=doubles(k))
    around = doubles(((turn - 1e-3, 0.0, 1.0), (turn + 1e-3, 0.0, 1.0)))
    points, exists = lens.points(around)
    assert exists.tolist() == [True, False]
    back, seen = lens.directions(points)
    assert seen[0]
    torch.testing.assert_close(back[0, 0] / back[0, 2], around[0, 0])


def test_pixels_beyond_the_fold_of_tangential_distortion_do_not_exist() -> None:
    lens = OpenCVPinhole(tangential=doubles((0.0, 0.2)))  # x + 0.6 x² along y = 0 folds at -5/6
    ideal = doubles(((-0.8, 0.0, 1.0), (-0.9, 0.0, 1.0), (-3.0, 0.0, 1.0)))
    assert lens.points(ideal)[1].tolist() == [True, False, False]
    assert not lens.directions(doubles((-0.5, 0.0)))[1]


@pytest.mark.parametrize("strength", [0.03, 0.1, 0.3])
def test_directions_within_any_lens_return_to_themselves(strength: float) -> None:
    for _ in range(6):
        lens = OpenCVPinhole(
            radial=torch.randn(6, dtype=torch.float64) * strength,
            tangential=torch.randn(2, dtype=torch.float64) * strength * 0.05,
            thin_prism=torch.randn(4, dtype=torch.float64) * strength * 0.05,
        )
        directions = directions_in_front(400, 1.5)
        points, exists = lens.points(directions)
        back, seen = lens.directions(points)
        assert (exists & ~seen).sum() <= 1  # next to the fold
        both = exists & seen
        assert both.sum() > 20
        unit = torch.nn.functional.normalize(directions, dim=-1)
        torch.testing.assert_close(back[both], unit[both], atol=1e-6, rtol=0)


def test_a_mapping_that_rises_again_behind_its_fold_stays_folded() -> None:
    # Along y = 0: x + 0.6 x² + 0.02 x⁵, which falls between -0.93 and -1.88.
    lens = OpenCVPinhole(radial=doubles((0, 0.02, 0, 0, 0, 0)), tangential=doubles((0.0, 0.2)))
    assert lens.points(doubles(((-0.8, 0.0, 1.0), (-2.0, 0.0, 1.0))))[1].tolist() == [True, False]


def test_points_near_the_end_of_the_lens_find_their_way_back() -> None:
    lens = OpenCVPinhole(
        radial=doubles((-0.3, 0, 0, 0, 0, 0)), tangential=doubles((0.02, -0.01))
    )  # fmt: skip
    azimuth = torch.linspace(0, 2 * math.pi, 400, dtype=torch.float64)
    ring = 0.99 * math.sqrt(1 / 0.9) * torch.stack([azimuth.cos(), azimuth.sin()], -1)
    points, exists = lens.points(torch.cat([ring, torch.ones_like(ring[:, :1])], -1))
    back, seen = lens.directions(points[exists])
    assert exists.sum() > 100
    assert seen.all()
    torch.testing.assert_close(back[:, :2] / back[:, 2:], ring[exists])


def test_the_backward_axis_has_no_place_on_a_fisheye_image() -> None:
    lens = OpenCVFisheye(coefficients=torch.zeros(4, dtype=torch.float64))
    behind = doubles(((0.0, 0.0, -1.0), (0.0, 1e-3, -1.0)))
    assert lens.points(behind)[1].tolist() == [False, True]
