from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ShapeError
from diff4splat.training.losses.photometric import perceptual_error, squared_error

F64 = torch.float64


class FirstPixel:
    """A distance that is easy to follow: |difference| of the first channel of the first pixel."""

    name = "test"

    def distance(self, image: torch.Tensor, reference: torch.Tensor) -> torch.Tensor:
        assert image.shape[1] == 3
        return (image - reference)[:, 0, 0, 0].abs()


def first_pixel_error(
    image: torch.Tensor, reference: torch.Tensor, valid: torch.Tensor | None = None
) -> torch.Tensor:
    return perceptual_error(image, reference, FirstPixel(), valid)


Loss = Callable[..., torch.Tensor]
LOSSES: tuple[Loss, ...] = (squared_error, first_pixel_error)


def images() -> list[torch.Tensor]:
    return [torch.rand(2, 3, 4, 5, 3, dtype=F64) for _ in range(2)]


def test_squared_error_and_distance() -> None:
    image, reference = images()
    squares = ((image - reference) ** 2).numpy().reshape(2, -1).mean(1)
    np.testing.assert_allclose(squared_error(image, reference), squares, rtol=1e-12)
    first = (image - reference)[:, :, 0, 0, 0].abs().numpy().mean(1)
    np.testing.assert_allclose(perceptual_error(image, reference, FirstPixel()), first, rtol=1e-12)


def test_only_valid_pixels_count() -> None:
    image, reference = images()
    valid = torch.rand(2, 3, 4, 5) < 0.5
    loss = squared_error(image, reference, valid)
    expected = [((image - reference)[b][valid[b]] ** 2).mean() for b in range(2)]
    torch.testing.assert_close(loss, torch.stack(expected))


def test_hidden_pixels_show_the_reference() -> None:
    image, reference = images()
    valid = torch.ones(2, 3, 4, 5, dtype=torch.bool)
    valid[:, :, 0, 0] = False
    image[:, :, 0, 0] = float("nan")
    reference[:, 1, 0, 0] = float("nan")
    image.requires_grad_()
    distance = perceptual_error(image, reference, FirstPixel(), valid)
    assert not distance.any()
    (distance + squared_error(image, reference, valid)).sum().backward()
    assert image.grad.isfinite().all()
    assert not image.grad[:, :, 0, 0].any()


def test_an_image_without_a_valid_pixel_does_not_count() -> None:
    image, reference = images()
    valid = torch.ones(2, 3, 4, 5, dtype=torch.bool)
    valid[0, 1:] = False
    valid[1] = False
    for loss_of in LOSSES:
        loss, alone = loss_of(image, reference, valid), loss_of(image[:1, :1], reference[:1, :1])
        assert loss.tolist() == pytest.approx([float(alone), 0])


@settings(max_examples=25, deadline=None)
@given(error=st.floats(-1, 1))
def test_a_constant_error_has_a_closed_form(error: float) -> None:
    _, reference = images()
    for loss_of, expected in zip(LOSSES, (error**2, abs(error)), strict=True):
        loss = loss_of(reference + error, reference)
        torch.testing.assert_close(
            loss, torch.full((2,), expected, dtype=F64), rtol=1e-9, atol=1e-12
        )


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_widened(dtype: torch.dtype) -> None:
    image = torch.full((1, 1, 64, 64, 3), 1e-4, dtype=dtype)
    loss = squared_error(image, torch.zeros_like(image))
    assert loss.dtype == torch.float32
    assert float(loss) == pytest.approx(float(image[0, 0, 0, 0, 0]) ** 2, rel=1e-5)


@pytest.mark.parametrize("loss_of", LOSSES)
def test_gradient(loss_of: Loss) -> None:
    image, reference = (p[:, :1, :2, :2] for p in images())
    image = image.detach().requires_grad_()
    assert torch.autograd.gradcheck(lambda own: loss_of(own, reference), image)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("loss_of", LOSSES)
def test_shapes(loss_of: Loss) -> None:
    image, reference = images()
    with pytest.raises(ShapeError, match=r"image: expected \(2, 3, 4, 5, 3\), got \(2, 1, 4"):
        loss_of(image[:, :1], reference)
    with pytest.raises(ShapeError, match=r"valid: expected \(2, 3, 4, 5\) bool, got \(2, 3, 4\)"):
        loss_of(image, reference, torch.ones(2, 3, 4, dtype=torch.bool))
