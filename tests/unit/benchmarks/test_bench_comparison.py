"""Errors of known size are reported as such."""

import math

import pytest
import torch
from ground_truth.brute_force import Pixels
from ground_truth.comparison import (
    gradient_error,
    gradient_errors,
    image_error,
    verdict,
    worst_gradient,
)
from ground_truth.pixel_samples import Truth
from hypothesis import given, settings
from hypothesis import strategies as st
from records import GradientError, ImageError

from diff4splat.scene.gaussians import Gaussians


def truth(rgb: torch.Tensor) -> Truth:
    count = len(rgb)
    return Truth(
        index=torch.arange(count),
        pixels=Pixels(
            rgb=rgb,
            doubtful=torch.arange(count) == 0,
            blended=torch.zeros(count, dtype=torch.long),
        ),
        blended_pairs=0.0,
        grad_index=torch.arange(1),
        grad=torch.ones(1, 3),
        gradients=None,
    )


def test_a_constant_offset_is_its_own_error() -> None:
    want = torch.full((12, 3), 0.5, dtype=torch.float64)
    found = image_error((want - 0.01).view(3, 4, 3), truth(want))
    assert found.psnr_db == pytest.approx(40.0)
    assert found.max_error == pytest.approx(0.01)
    assert found.bias == pytest.approx(-0.01)
    assert (found.wrong, found.doubtful, found.sampled) == (12, 1, 12)


def test_a_pixel_is_wrong_from_half_a_level_on() -> None:
    want = torch.zeros(4, 3, dtype=torch.float64)
    picture = want.clone()
    picture[1, 2], picture[2, 0] = 0.49 / 255, 0.51 / 255
    assert image_error(picture.view(2, 2, 3), truth(want)).wrong == 1


def test_an_equal_picture_has_no_error() -> None:
    want = torch.rand(4, 3, dtype=torch.float64)
    found = image_error(want.view(2, 2, 3), truth(want))
    assert found.psnr_db == math.inf
    assert verdict(found, ()) == "right"


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.5, 0.5))
def test_a_scaled_gradient_is_off_by_its_factor(factor: float) -> None:
    want = torch.tensor([[1.0, 2.0, 3.0], [0.5, 0.25, 4.0]], dtype=torch.float64)
    found = gradient_error("means", want * (1 + factor), want, 0.0)
    assert found.relative_l2 == pytest.approx(abs(factor))
    assert found.bias == pytest.approx(factor)
    assert found.cosine == pytest.approx(1.0)
    assert found.worst <= abs(factor) / 1e-2 + 1e-12


def test_one_bad_element_shows_in_the_worst_only() -> None:
    want = torch.ones(1000, dtype=torch.float64)
    off = want.clone()
    off[7] = 1.2
    found = gradient_error("opacities", off, want, 0.0)
    assert found.relative_l2 < 1e-2
    assert found.worst == pytest.approx(0.2 / (1e-4 + 1e-2))


def test_a_gradient_that_vanishes_is_not_compared() -> None:
    def gaussians(quats: float) -> Gaussians:
        ones = torch.ones(2, 3, dtype=torch.float64)
        return Gaussians(
            means=ones,
            quats=torch.full((2, 4), quats, dtype=torch.float64),
            scales=ones,
            opacities=ones[:, 0],
            sh=ones[:, None],
        )

    found = gradient_errors(gaussians(1e-7), gaussians(1e-12))
    assert [error.parameter for error in found if error.relative_l2 is None] == ["quats"]
    assert verdict(None, found) == "right"


def image(psnr_db: float) -> ImageError:
    return ImageError(psnr_db=psnr_db, max_error=0, wrong=0, bias=0, doubtful=0, sampled=1)


def error(parameter: str, size: float | None) -> GradientError:
    return GradientError(parameter=parameter, relative_l2=size, cosine=1, bias=0, worst=0)


def test_the_verdict_names_what_is_wrong() -> None:
    found = (error("means", 1e-5), error("quats", 0.3), error("scales", math.nan))
    assert verdict(image(59.0), found) == "wrong: picture, quats, scales"
    assert verdict(image(math.nan), ()) == "wrong: picture"
    assert verdict(image(61.0), found[:1]) == "right"
    assert worst_gradient(found).parameter == "scales"
    assert worst_gradient(found[:2]).parameter == "quats"
    assert worst_gradient([error("quats", None)]) is None
