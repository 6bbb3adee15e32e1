import math

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.metrics.image import mse, psnr


def test_a_constant_error_has_a_closed_form() -> None:
    reference = torch.rand(2, 4, 5, 3, dtype=torch.float64)
    image = reference + torch.tensor([0.1, 0.01], dtype=torch.float64)[:, None, None, None]
    torch.testing.assert_close(
        mse(image, reference), torch.tensor([1e-2, 1e-4], dtype=torch.float64)
    )
    torch.testing.assert_close(
        psnr(image, reference), torch.tensor([20.0, 40.0], dtype=torch.float64)
    )


def test_the_order_of_the_axes_does_not_matter() -> None:
    image, reference = torch.rand(2, 3, 4, 5, dtype=torch.float64)
    moved = psnr(image.movedim(-1, 0), reference.movedim(-1, 0))
    torch.testing.assert_close(psnr(image, reference), moved)


def test_identical_images_have_no_noise() -> None:
    assert float(psnr(torch.ones(2, 2, 3), torch.ones(2, 2, 3))) == math.inf


def test_half_precision_is_summed_in_float32() -> None:
    image = torch.full((64, 64, 3), 1e-4, dtype=torch.float16)
    error = mse(image, torch.zeros_like(image))
    assert error.dtype == torch.float32
    torch.testing.assert_close(float(error), float(image[0, 0, 0]) ** 2, rtol=1e-5, atol=0.0)


def test_the_error_is_differentiable() -> None:
    image = torch.rand(2, 2, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda own: psnr(own, torch.zeros_like(own)), image)


@pytest.mark.usefixtures("as_shipped")
def test_shapes_must_agree() -> None:
    with pytest.raises(ShapeError, match=r"expected \(2, 2, 3\), got \(2, 3, 3\)"):
        psnr(torch.zeros(2, 3, 3), torch.zeros(2, 2, 3))


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize("shape", [(0, 2, 3), (2, 3)])
def test_an_image_has_pixels(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match="expected three axes of at least 1"):
        mse(torch.zeros(shape), torch.zeros(shape))
