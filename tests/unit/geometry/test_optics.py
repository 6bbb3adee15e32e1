"""Apertures, shutters and exposures: what is accepted, and when a frame sees."""

import math

import pytest
import torch

from diff4splat.errors import InputError
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.optics import (
    Aperture,
    Optics,
    Shutter,
    as_float,
    is_learned,
    require_frame_holds,
)


def test_the_default_is_a_pinhole_that_takes_no_time() -> None:
    optics = Optics()
    assert isinstance(optics.lens, Pinhole)
    assert optics.duration_s == 0.0
    assert optics.window_s(2.5) == (2.5, 2.5)


@pytest.mark.parametrize(
    ("timestamp", "window"), [("middle", (4.97, 5.03)), ("start", (5.0, 5.06))]
)
def test_a_frame_sees_read_out_and_exposure(timestamp: str, window: tuple[float, float]) -> None:
    optics = Optics(shutter=Shutter(readout_s=0.04), exposure_s=0.02, timestamp=timestamp)
    assert optics.duration_s == pytest.approx(0.06)
    assert optics.window_s(5.0) == pytest.approx(window)


@pytest.mark.parametrize("bad", [-1e-9, math.nan, math.inf, torch.tensor(-1.0)])
def test_negative_and_infinite_numbers_are_refused(bad: float) -> None:
    makers = {
        r"Aperture\.radius": lambda: Aperture(radius=bad, focus_distance=1.0),
        r"Aperture\.focus_distance": lambda: Aperture(radius=0.0, focus_distance=bad),
        r"Shutter\.readout_s": lambda: Shutter(readout_s=bad),
        r"Optics\.exposure_s": lambda: Optics(exposure_s=bad),
    }
    for name, make in makers.items():
        with pytest.raises(InputError, match=f"{name}: expected a finite number"):
            make()


def test_nothing_is_focused_at_the_lens_itself() -> None:
    with pytest.raises(InputError, match=r"focus_distance: expected a finite number above 0"):
        Aperture(radius=0.1, focus_distance=0.0)


def test_a_frame_must_be_over_when_the_next_begins() -> None:
    optics = Optics(shutter=Shutter(readout_s=1 / 60), exposure_s=1 / 60)
    require_frame_holds(optics, 1 / 30, "video")
    with pytest.raises(InputError, match=r"video: expected read-out and exposure of at most 0\.03"):
        require_frame_holds(optics, 0.03, "video")


def test_tensors_move_and_numbers_stay() -> None:
    radius = torch.tensor(0.1, requires_grad=True)
    optics = Optics(
        lens=OpenCVFisheye(coefficients=torch.zeros(4)),
        aperture=Aperture(radius=radius, focus_distance=2.0),
        shutter=Shutter(readout_s=torch.tensor(0.01), direction="right-to-left"),
        exposure_s=torch.tensor(0.02),
    ).to(torch.float64)
    assert optics.aperture.radius.dtype == optics.exposure_s.dtype == torch.float64
    assert optics.shutter.readout_s.dtype == optics.lens.coefficients.dtype == torch.float64
    assert optics.aperture.focus_distance == 2.0
    assert optics.shutter.direction == "right-to-left"
    optics.aperture.radius.backward()
    assert float(radius.grad) == 1.0


def test_values_are_read_without_their_gradients() -> None:
    number = torch.tensor(0.25, requires_grad=True)
    optics = Optics(shutter=Shutter(readout_s=number), exposure_s=number)
    assert is_learned(number)
    assert not is_learned(number.detach())
    assert not is_learned(0.25)
    assert as_float(number) == as_float(0.25) == 0.25
    assert optics.duration_s == 0.5
