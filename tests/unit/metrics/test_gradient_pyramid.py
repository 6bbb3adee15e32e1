import numpy as np
import oracles_metrics as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from diff4splat.errors import ShapeError
from diff4splat.metrics.features.gradient_pyramid import GradientPyramidFeatures

F64 = torch.float64
FEATURES = GradientPyramidFeatures()


def scene(size: int = 64, seed: int = 0) -> torch.Tensor:
    """Overlapping coloured discs with a little texture, ``1 3 h w``: edges, flats and detail."""
    generator = torch.Generator().manual_seed(seed)
    rows, columns = torch.meshgrid(torch.arange(size), torch.arange(size), indexing="ij")
    image = torch.full((3, size, size), 0.5, dtype=F64)
    for _ in range(12):
        (y, x, radius), color = (torch.rand(3, generator=generator, dtype=F64) for _ in "ab")
        inside = (rows - y * size) ** 2 + (columns - x * size) ** 2 < (radius * size / 4) ** 2
        image = torch.where(inside, color[:, None, None], image)
    texture = torch.rand(3, size, size, generator=generator, dtype=F64) - 0.5
    return (image + 0.04 * texture).clamp(0, 1)[None]


def blurred(image: torch.Tensor, sigma: float) -> torch.Tensor:
    return torch.from_numpy(ndimage.gaussian_filter(image.numpy(), (0, 0, sigma, sigma)))


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (5, 9), (8, 8), (24, 50)])
def test_against_the_formula(size: tuple[int, int]) -> None:
    other, reference = torch.rand(2, 2, 3, *size, dtype=F64)
    expected = [
        oracle.gradient_pyramid(one.numpy(), other.numpy())
        for one, other in zip(other, reference, strict=True)
    ]
    np.testing.assert_allclose(FEATURES.distance(other, reference), expected, rtol=1e-10)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 999), height=st.integers(1, 12), width=st.integers(1, 12))
def test_it_is_symmetric_bounded_and_finite(seed: int, height: int, width: int) -> None:
    torch.manual_seed(seed)
    other, reference = torch.rand(2, 1, 3, height, width, dtype=F64)
    other.requires_grad_()
    there, back = FEATURES.distance(other, reference), FEATURES.distance(reference, other)
    there.sum().backward()
    torch.testing.assert_close(there, back)
    assert (there >= 0).all()
    assert (there <= 2).all()
    assert other.grad.isfinite().all()


@pytest.mark.parametrize("size", [1, 8, 32])
def test_equal_images_have_no_distance_and_no_gradient(size: int) -> None:
    image = scene(size)
    own = image.clone().requires_grad_()
    distance = FEATURES.distance(own, image)
    distance.sum().backward()
    assert not distance.any()
    assert not own.grad.any()


@pytest.mark.parametrize("seed", range(3))
def test_more_blur_and_more_noise_are_worse(seed: int) -> None:
    image = scene(seed=seed)
    noise = torch.randn(image.shape, dtype=F64)
    for worse in (
        [blurred(image, sigma) for sigma in (0.5, 1, 2, 3, 5)],
        [image + size * noise for size in (0.01, 0.03, 0.1, 0.2, 0.4)],
        [image + size for size in (0.01, 0.03, 0.1)],
    ):
        distances = torch.cat([FEATURES.distance(other, image) for other in worse])
        assert (distances.diff() > 0).all()
        assert distances[0] > 0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("axis", [-1, -2])
def test_a_shift_is_forgiven_more_than_by_squared_error(seed: int, axis: int) -> None:
    wide = scene(80, seed)
    image, moved = wide[..., 8:72, 8:72], wide.roll(1, axis)[..., 8:72, 8:72]
    soft = blurred(wide, 2.0)[..., 8:72, 8:72]

    def squared(other: torch.Tensor) -> float:
        return float((other - image).square().mean())

    ratio = float(FEATURES.distance(moved, image) / FEATURES.distance(soft, image))
    assert ratio < 0.7 * squared(moved) / squared(soft)


def test_gradient() -> None:
    other, reference = torch.rand(2, 1, 3, 7, 6, dtype=F64)
    other.requires_grad_()
    assert torch.autograd.gradcheck(lambda own: FEATURES.distance(own, reference), other)


@pytest.mark.parametrize("fill", [0.0, 1e-30, 1e6])
def test_extreme_images_stay_finite(fill: float) -> None:
    other = torch.full((1, 3, 16, 16), fill, requires_grad=True)
    distance = FEATURES.distance(other, torch.rand(1, 3, 16, 16))
    distance.sum().backward()
    assert distance.isfinite().all()
    assert other.grad.isfinite().all()


def test_half_precision_is_widened_and_stays_wide() -> None:
    other, reference = torch.rand(2, 1, 3, 16, 16).bfloat16()
    distance = FEATURES.distance(other, reference)
    assert distance.dtype == torch.float32
    torch.testing.assert_close(distance, FEATURES.distance(other.float(), reference.float()))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(FEATURES.distance(other, reference), distance)


@pytest.mark.usefixtures("as_shipped")
def test_shapes() -> None:
    with pytest.raises(ShapeError, match=r"image: expected \(2, 3, 4, 4\), got \(1, 3, 4, 4\)"):
        FEATURES.distance(torch.zeros(1, 3, 4, 4), torch.zeros(2, 3, 4, 4))
    with pytest.raises(ShapeError, match=r"expected a pixel, got \(1, 3, 0, 4\)"):
        FEATURES.distance(*torch.zeros(2, 1, 3, 0, 4))
