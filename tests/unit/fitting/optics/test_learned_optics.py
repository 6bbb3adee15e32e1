"""Cameras among the numbers of a fit: they start where the capture says, and stay sound."""

import math
from functools import cache

import pytest
import torch
from traced_fits import photographed, said, scene

from diff4splat.data.capture.capture import Capture
from diff4splat.errors import ConfigError
from diff4splat.fitting.optics import coefficients
from diff4splat.fitting.optics.camera_model import differs_from_pinhole
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.parameter_table import ParameterTable
from diff4splat.fitting.settings import LearningRates
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.lenses.blender_fisheye import BLENDER_DEFAULT, BlenderFisheye
from diff4splat.geometry.lenses.build import blender_camera, fisheye_camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.optics import Aperture, Optics, Shutter

FISHEYE = OpenCVFisheye(coefficients=torch.tensor([0.02, 0.0, 0.0, 0.0]).double())
EVERYTHING = Optics(
    lens=FISHEYE,
    aperture=Aperture(radius=0.1, focus_distance=2.0),
    shutter=Shutter(readout_s=0.05),
)


@cache
def capture() -> Capture:
    return photographed(scene(), Optics(lens=FISHEYE))


NAMES = ("lens", "focus", "aperture", "readout", "focal")


def learned(optics: Optics, names: tuple[str, ...]) -> tuple[LearnedOptics, ParameterTable]:
    parts = LearnedOptics(said(capture(), optics), names)
    return parts, ParameterTable({"means": torch.zeros(1, 3)}, parts.shared())


def test_everything_starts_where_the_capture_says():
    parts, table = learned(EVERYTHING, NAMES)
    found = parts.model(table)
    torch.testing.assert_close(found.optics.lens.coefficients, FISHEYE.coefficients)
    assert float(found.optics.aperture.focus_distance.detach()) == 2.0
    assert float(found.optics.aperture.radius.detach()) == pytest.approx(0.1)
    assert float(found.optics.shutter.readout_s.detach()) == pytest.approx(0.05)
    assert float(found.focal_factor.detach()) == 1.0
    assert set(parts.rates(LearningRates(), 0.0)) == set(parts.names)
    assert all(facts["start"] == facts["recovered"] for facts in parts.report(table).values())


def test_only_a_camera_that_is_learning_has_gradients():
    parts, table = learned(EVERYTHING, NAMES)
    assert not parts.model(table, learning=False).optics.aperture.radius.requires_grad
    model = parts.model(table)
    pixel = model.camera(capture(), 0).camera.focal_px.sum()
    total = model.optics.lens.coefficients.sum() + model.optics.shutter.readout_s + pixel
    total.backward()
    assert all(table[name].grad is not None for name in ("camera_lens", "camera_focal"))


@pytest.mark.parametrize(
    ("lens", "camera"),
    [
        (FISHEYE, fisheye_camera(150.0, (40, 60), FISHEYE, torch.float64)),
        (
            OpenCVPinhole(radial=torch.tensor([-0.1, 0.02, 0, 0, 0, 0]).double()),
            pinhole(40.0, (40, 60), torch.float64),
        ),
        (
            BlenderFisheye(coefficients=torch.tensor(BLENDER_DEFAULT).double()),
            blender_camera((40, 60), dtype=torch.float64),
        ),
    ],
)
def test_a_mode_moves_the_image_by_a_pixel_and_no_two_alike(lens, camera):
    changes = coefficients.displacement_modes(lens, camera)
    assert changes.shape[1] >= 3
    directions, exist = lens.directions(coefficients.image_plane_grid(camera))
    small, moved = 1e-5, []
    for mode in changes.T:
        pair = [
            coefficients.with_coefficients(
                lens, coefficients.coefficient_vector(lens) + side * small * mode
            )
            for side in (-0.5, 0.5)
        ]
        early, late = (other.points(directions[exist])[0] for other in pair)
        moved.append(((late - early) * camera.focal_px / small).flatten())
    moved = torch.stack(moved)
    alike = moved @ moved.T / int(exist.sum())
    torch.testing.assert_close(alike, torch.eye(len(moved)).double(), atol=2e-3, rtol=0)


def test_coefficients_that_are_not_learned_stay():
    lens = BlenderFisheye(coefficients=torch.tensor(BLENDER_DEFAULT).double())
    other = coefficients.with_coefficients(lens, coefficients.coefficient_vector(lens) * 2)
    assert float(other.coefficients[0]) == 0.0
    torch.testing.assert_close(other.coefficients[1:], 2 * lens.coefficients[1:])
    radial = torch.tensor([-0.1, 0, 0, 0.3, 0, 0])
    assert coefficients.learnable_indices(OpenCVPinhole(radial=radial))["radial"].tolist() == [
        0,
        1,
        2,
        3,
    ]


def test_a_lens_that_folds_back_goes_back_and_starts_anew():
    parts, table = learned(EVERYTHING, ("lens", "focus"))
    with torch.no_grad():
        table["camera_lens"][0] = 0.5
    parts.clamp(table)
    assert float(table["camera_lens"].detach()[0]) == 0.5
    table["camera_lens"].grad = torch.ones_like(table["camera_lens"])
    table.step({"camera_lens": 0.01})
    with torch.no_grad():
        table["camera_lens"][0] = -80.0
        table["camera_focus"].fill_(50.0)
    parts.clamp(table)
    assert float(table["camera_lens"].detach()[0]) == 0.5
    assert "camera_lens/exp_avg" not in table.tensors()
    assert float(table["camera_focus"].detach()) == pytest.approx(math.log(20.0))


def test_numbers_that_are_not_finite_go_back_too():
    parts, table = learned(EVERYTHING, ("lens", "readout"))
    for name in parts.names:
        with torch.no_grad():
            table[name].fill_(math.nan)
    parts.clamp(table)
    assert not any(bool(table[name].detach().any()) for name in parts.names)


@pytest.mark.parametrize(
    ("name", "optics", "message"),
    [
        ("lens", Optics(), "lens with coefficients"),
        ("lens", Optics(lens=Equirectangular()), "Equirectangular"),
        ("focus", Optics(), "an aperture"),
        ("aperture", Optics(lens=FISHEYE), "an aperture"),
        ("readout", Optics(), "a read-out above 0"),
        ("readout", Optics(shutter=Shutter(readout_s=0.0)), "first guess"),
    ],
)
def test_what_the_capture_does_not_say_cannot_be_learned(name: str, optics: Optics, message: str):
    with pytest.raises(ConfigError, match=message):
        learned(optics, (name,))


def test_distortion_of_nothing_is_drawn_as_a_pinhole():
    assert not differs_from_pinhole(Optics(lens=OpenCVPinhole()))
    bent = OpenCVPinhole(radial=torch.tensor([0.1, 0, 0, 0, 0, 0]))
    assert (
        differs_from_pinhole(Optics(lens=bent))
        and not differs_from_pinhole(Optics())
        and not differs_from_pinhole(None)
    )
