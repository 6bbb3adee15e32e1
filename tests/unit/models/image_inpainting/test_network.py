"""MI-GAN: what it keeps, what it cannot see, and that its values are finite."""

import pytest
import torch
from torch import Tensor

from diff4splat.models.image_inpainting.network import ImageInpainting

WIDTHS = (4, 6, 8)


@pytest.fixture(scope="module")
def network() -> ImageInpainting:
    torch.manual_seed(0)
    return ImageInpainting(WIDTHS).eval()


def inputs(height: int = 8, width: int = 12, share: float = 0.6) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(1)
    image = torch.rand(2, 3, height, width, generator=generator)
    return image, torch.rand(2, height, width, generator=generator) < share


def test_what_is_known_stays(network: ImageInpainting) -> None:
    image, known = inputs()
    with torch.no_grad():
        found = network(image, known)
    kept = known[:, None].expand_as(image)
    assert torch.equal(found[kept], image[kept])
    assert bool((found[~kept] != image[~kept]).any())
    assert float(found.min()) >= 0 and float(found.max()) <= 1


def test_unknown_colours_are_not_seen(network: ImageInpainting) -> None:
    image, known = inputs()
    other = torch.where(known[:, None], image, 1 - image)
    unknown = ~known[:, None].expand_as(image)
    assert torch.equal(network(image, known)[unknown], network(other, known)[unknown])


def test_images_of_a_batch_do_not_meet(network: ImageInpainting) -> None:
    image, known = inputs()
    both = network(image, known)
    torch.testing.assert_close(both[1:], network(image[1:], known[1:]))


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_nothing_known_and_everything_known(network: ImageInpainting, share: float) -> None:
    image, known = inputs(share=share)
    found = network(image, known)
    assert bool(found.isfinite().all()) and torch.equal(found, image) == bool(share)


def test_sides_are_multiples_of_the_coarsest_level(network: ImageInpainting) -> None:
    assert network.multiple_px == 4
    assert network(*inputs(4, 4)).shape == (2, 3, 4, 4)


def test_gradients_are_finite(network: ImageInpainting) -> None:
    image, known = inputs()
    network(image, known).sum().backward()
    gradients = [parameter.grad for parameter in network.parameters()]
    assert all(gradient is not None and bool(gradient.isfinite().all()) for gradient in gradients)
    assert any(bool(gradient.any()) for gradient in gradients)
