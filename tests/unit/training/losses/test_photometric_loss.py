import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.training.losses.photometric import photometric

F64 = torch.float64


class FirstPixel:
    """A distance that is easy to follow: |difference| of the first channel of the first pixel."""

    name = "test"

    def __init__(self) -> None:
        self.calls = 0

    def distance(self, image: torch.Tensor, reference: torch.Tensor) -> torch.Tensor:
        self.calls += 1
        assert image.shape[1] == 3
        return (image - reference)[:, 0, 0, 0].abs()


def pictures() -> list[torch.Tensor]:
    return [torch.rand(2, 3, 4, 5, 3, dtype=F64) for _ in range(2)]


def test_squared_error_and_distance() -> None:
    image, reference = pictures()
    loss = photometric(image, reference, features=FirstPixel(), perceptual_weight=0.5)
    squares = ((image - reference) ** 2).numpy().reshape(2, -1).mean(1)
    first = (image - reference)[:, :, 0, 0, 0].abs().numpy().mean(1)
    np.testing.assert_allclose(loss, squares + 0.5 * first, rtol=1e-12)


def test_weight_zero_never_calls_the_network() -> None:
    features = FirstPixel()
    photometric(*pictures(), features=features, perceptual_weight=0.0)
    assert features.calls == 0


def test_only_valid_pixels_count() -> None:
    image, reference = pictures()
    valid = torch.rand(2, 3, 4, 5) < 0.5
    loss = photometric(image, reference, valid=valid)
    expected = [((image - reference)[b][valid[b]] ** 2).mean() for b in range(2)]
    torch.testing.assert_close(loss, torch.stack(expected))


def test_hidden_pixels_show_the_reference() -> None:
    image, reference = pictures()
    valid = torch.ones(2, 3, 4, 5, dtype=torch.bool)
    valid[:, :, 0, 0] = False
    image[:, :, 0, 0] = float("nan")
    reference[:, 1, 0, 0] = float("nan")
    image.requires_grad_()
    loss = photometric(image, reference, features=FirstPixel(), perceptual_weight=0.5, valid=valid)
    loss.sum().backward()
    torch.testing.assert_close(loss, photometric(image, reference, valid=valid))
    assert image.grad.isfinite().all()
    assert not image.grad[:, :, 0, 0].any()


def test_a_picture_without_a_valid_pixel_does_not_count() -> None:
    image, reference = pictures()
    valid = torch.ones(2, 3, 4, 5, dtype=torch.bool)
    valid[0, 1:] = False
    valid[1] = False
    loss = photometric(image, reference, features=FirstPixel(), perceptual_weight=1.0, valid=valid)
    alone = photometric(
        image[:1, :1], reference[:1, :1], features=FirstPixel(), perceptual_weight=1.0
    )
    assert loss.tolist() == pytest.approx([float(alone), 0])


@settings(max_examples=25, deadline=None)
@given(error=st.floats(-1, 1), weight=st.floats(0, 4))
def test_a_constant_error_has_a_closed_form(error: float, weight: float) -> None:
    _, reference = pictures()
    loss = photometric(
        reference + error, reference, features=FirstPixel(), perceptual_weight=weight
    )
    expected = torch.full((2,), error**2 + weight * abs(error), dtype=F64)
    torch.testing.assert_close(loss, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_widened(dtype: torch.dtype) -> None:
    image = torch.full((1, 1, 64, 64, 3), 1e-4, dtype=dtype)
    loss = photometric(image, torch.zeros_like(image))
    assert loss.dtype == torch.float32
    assert float(loss) == pytest.approx(float(image[0, 0, 0, 0, 0]) ** 2, rel=1e-5)


def test_gradient() -> None:
    image, reference = (p[:, :1, :2, :2] for p in pictures())
    image = image.detach().requires_grad_()
    assert torch.autograd.gradcheck(
        lambda own: photometric(own, reference, features=FirstPixel(), perceptual_weight=0.5), image
    )


@pytest.mark.usefixtures("as_shipped")
def test_settings_and_shapes() -> None:
    image, reference = pictures()
    with pytest.raises(ConfigError, match="expected features for a weight above 0, got none"):
        photometric(image, reference, perceptual_weight=0.5)
    with pytest.raises(ConfigError, match="expected 0 or more, got nan"):
        photometric(image, reference, perceptual_weight=float("nan"))
    with pytest.raises(ShapeError, match=r"image: expected \(2, 3, 4, 5, 3\), got \(2, 1, 4"):
        photometric(image[:, :1], reference)
    with pytest.raises(ShapeError, match=r"valid: expected \(2, 3, 4, 5\) bool, got \(2, 3, 4\)"):
        photometric(image, reference, valid=torch.ones(2, 3, 4, dtype=torch.bool))
