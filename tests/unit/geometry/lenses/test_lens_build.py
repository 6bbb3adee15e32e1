"""Cameras made for lenses, the equirectangular image, and what constructors refuse."""

import math

import pytest
import torch
from lens_cases import doubles

from diff4splat.errors import InputError, ShapeError
from diff4splat.geometry.lenses.blender_fisheye import BLENDER_DEFAULT, BlenderFisheye
from diff4splat.geometry.lenses.build import (
    blender_camera,
    equirectangular_camera,
    fisheye_camera,
)
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.sensor import sensor_directions


@pytest.mark.parametrize("size_px", [(300, 400), (400, 300)])
def test_the_longer_side_of_a_blender_image_spans_the_sensor(size_px: tuple[int, int]) -> None:
    camera = blender_camera(size_px)
    assert (max(size_px) / camera.focal_px).tolist() == pytest.approx([36.0, 36.0])
    assert camera.center_px.tolist() == [size_px[1] / 2, size_px[0] / 2]


@pytest.mark.parametrize("fov_deg", [60.0, 180.0, 250.0])
def test_the_field_of_view_of_a_fisheye_spans_the_width(fov_deg: float) -> None:
    lens = OpenCVFisheye(coefficients=doubles((0.02, -0.003, 5e-4, -2e-5)))
    camera = fisheye_camera(fov_deg, (480, 640), lens, torch.float64)
    edges, exists = sensor_directions(camera, lens, doubles(((0.0, 240.0), (640.0, 240.0))))
    half = math.radians(fov_deg / 2)
    assert exists.all()
    wanted = [[-math.sin(half), 0, math.cos(half)], [math.sin(half), 0, math.cos(half)]]
    torch.testing.assert_close(edges, doubles(wanted))


@pytest.mark.parametrize("fov_deg", [0.0, -10.0, 121.0, math.nan])
def test_a_fisheye_camera_sees_no_further_than_its_lens(fov_deg: float) -> None:
    lens = OpenCVFisheye(coefficients=torch.zeros(4), max_angle_rad=math.radians(60))
    with pytest.raises(InputError, match="at most the 120 degrees"):
        fisheye_camera(fov_deg, (480, 640), lens)


@pytest.mark.parametrize("sensor_mm", [0.0, -36.0, math.inf, math.nan])
def test_a_sensor_has_a_size(sensor_mm: float) -> None:
    with pytest.raises(InputError, match="sensor_mm"):
        blender_camera((480, 640), sensor_mm)


def test_directions_on_the_equirectangular_image() -> None:
    camera = equirectangular_camera((100, 200), torch.float64)
    pixels = doubles(((100, 50), (150, 50), (50, 50), (0, 50), (100, 100), (100, 0), (125, 75)))
    directions, exists = sensor_directions(camera, Equirectangular(), pixels)
    half = math.sqrt(0.5)
    wanted = [[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 0, -1], [0, 1, 0], [0, -1, 0], [0.5, half, 0.5]]
    assert exists.all()
    torch.testing.assert_close(directions, doubles(wanted))


def test_outside_the_equirectangular_image_is_nothing() -> None:
    camera = equirectangular_camera((100, 200))
    pixels = torch.tensor(
        [[-0.5, 50.0], [200.5, 50.0], [100.0, -0.5], [100.0, 100.5], [200.0, 0.0]]
    )
    _, exists = sensor_directions(camera, Equirectangular(), pixels)
    assert exists.tolist() == [False, False, False, False, True]


def test_the_whole_sphere_is_on_the_equirectangular_image() -> None:
    directions = torch.cat([torch.randn(100, 3), torch.eye(3), -torch.eye(3)]).double()
    points, exists = Equirectangular().points(directions)
    back, _ = Equirectangular().directions(points)
    assert exists.all()
    torch.testing.assert_close(back, torch.nn.functional.normalize(directions, dim=-1))


@pytest.mark.parametrize("count", [0, 3, 5])
def test_a_wrong_number_of_coefficients_is_refused(count: int, as_shipped: None) -> None:
    with pytest.raises(ShapeError, match="coefficients: expected"):
        OpenCVFisheye(coefficients=torch.zeros(count))
    with pytest.raises(ShapeError, match="radial: expected"):
        OpenCVPinhole(radial=torch.zeros(count))
    with pytest.raises(ShapeError, match="coefficients: expected"):
        BlenderFisheye(coefficients=torch.zeros(count + 1))


def test_whole_numbers_are_no_coefficients(as_shipped: None) -> None:
    with pytest.raises(ShapeError, match="floating-point"):
        OpenCVFisheye(coefficients=torch.zeros(4, dtype=torch.int64))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_coefficients_that_are_no_numbers_are_refused(bad: float) -> None:
    with pytest.raises(InputError, match="finite"):
        OpenCVFisheye(coefficients=torch.tensor([0.0, bad, 0.0, 0.0]))
    with pytest.raises(InputError, match="finite"):
        OpenCVPinhole(thin_prism=torch.tensor([0.0, bad, 0.0, 0.0]))
    with pytest.raises(InputError, match="finite"):
        BlenderFisheye(coefficients=torch.tensor([bad, 1.0, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize("angle", [0.0, -1.0, 7.0, math.nan])
def test_angles_beyond_a_full_turn_are_refused(angle: float) -> None:
    with pytest.raises(InputError, match="max_angle_rad"):
        OpenCVFisheye(coefficients=torch.zeros(4), max_angle_rad=angle)
    with pytest.raises(InputError, match="fov_rad"):
        BlenderFisheye(coefficients=torch.tensor(BLENDER_DEFAULT), fov_rad=angle)


def test_a_polynomial_that_falls_at_the_centre_is_refused() -> None:
    with pytest.raises(InputError, match="positive k_1 with cycles_signs=False"):
        BlenderFisheye(coefficients=-torch.tensor(BLENDER_DEFAULT))
    with pytest.raises(InputError, match="negative k_1 with cycles_signs=True"):
        BlenderFisheye(coefficients=torch.tensor(BLENDER_DEFAULT), cycles_signs=True)
    with pytest.raises(InputError, match=r"got 0\.0"):
        BlenderFisheye(coefficients=torch.zeros(5))


def test_the_calibrated_cone_is_respected() -> None:
    lens = OpenCVFisheye(coefficients=torch.zeros(4), max_angle_rad=1.0)
    assert lens.largest_angle_rad == 1.0
    angles = torch.tensor([0.99, 1.01])
    directions = torch.stack([angles.sin(), torch.zeros(2), angles.cos()], -1)
    assert lens.points(directions)[1].tolist() == [True, False]
    assert lens.directions(torch.stack([angles, torch.zeros(2)], -1))[1].tolist() == [True, False]
