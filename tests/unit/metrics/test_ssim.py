import numpy as np
import oracles_metrics as oracle
import pytest
import torch
from skimage.metrics import structural_similarity

from diff4splat.errors import ShapeError
from diff4splat.metrics.ssim import ssim

F64 = torch.float64


def pair(*size: int) -> tuple[torch.Tensor, torch.Tensor]:
    reference = torch.rand(*size, 3, dtype=F64)
    return (reference + 0.1 * torch.randn(reference.shape, dtype=F64)).clamp(0, 1), reference


def test_against_the_formula_and_scikit_image() -> None:
    image, reference = pair(2, 13, 16)
    got = ssim(image, reference).numpy()
    expected = [oracle.ssim(image[i].numpy(), reference[i].numpy()) for i in range(2)]
    np.testing.assert_allclose(got, expected, rtol=1e-10)
    theirs = [
        structural_similarity(
            image[i].numpy(),
            reference[i].numpy(),
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            data_range=1.0,
            channel_axis=-1,
        )
        for i in range(2)
    ]
    np.testing.assert_allclose(got, theirs, rtol=1e-10)


@pytest.mark.parametrize("fill", [None, 0.0, 1.0])
def test_equal_images(fill: float | None) -> None:
    image = torch.rand(11, 12, 3, dtype=F64) if fill is None else torch.full((11, 12, 3), fill)
    own = image.clone().requires_grad_()
    similarity = ssim(own, image)
    similarity.backward()
    assert float(similarity.detach()) == pytest.approx(1, abs=1e-6)
    assert own.grad.isfinite().all()


def test_flat_images_have_a_closed_form() -> None:
    black, white = torch.zeros(11, 11, 3, dtype=F64), torch.ones(11, 11, 3, dtype=F64)
    assert float(ssim(black, white)) == pytest.approx(1e-4 / (1 + 1e-4))


def test_half_precision_is_widened() -> None:
    image, reference = (part.bfloat16() for part in pair(1, 12, 12))
    got = ssim(image, reference)
    assert got.dtype == torch.float32
    torch.testing.assert_close(
        got.double(), ssim(image.double(), reference.double()), rtol=1e-4, atol=1e-5
    )


def test_gradient() -> None:
    image, reference = pair(11, 12)
    image = image.requires_grad_()
    assert torch.autograd.gradcheck(ssim, (image, reference), atol=1e-6)


@pytest.mark.usefixtures("as_shipped")
def test_shapes() -> None:
    with pytest.raises(ShapeError, match=r"expected h w 3 with at least 11 px a side, got \(10"):
        ssim(*torch.zeros(2, 10, 20, 3))
    with pytest.raises(ShapeError, match=r"image: expected \(12, 20, 3\), got \(11, 20, 3\)"):
        ssim(torch.zeros(11, 20, 3), torch.zeros(12, 20, 3))
