"""An image of any size through a network that takes some sizes."""

import pytest
import torch
from image_layers import random_rgb
from torch import Tensor

from diff4splat.generation.layered_image import inpainting
from diff4splat.generation.layered_image.inpainting import NetworkInpainting, on_copy


class Painter:
    """A network that paints its own row number, and keeps what it was asked."""

    multiple_px = 8

    def __init__(self) -> None:
        self.image = self.known = torch.empty(0)
        self.threads = 0

    def __call__(self, image: Tensor, known: Tensor) -> Tensor:
        self.image, self.known, self.threads = image, known, torch.get_num_threads()
        rows = torch.arange(image.shape[2])[:, None] / 1000
        return torch.where(known[:, None], image, rows.expand_as(image))


def hole(height: int, width: int) -> Tensor:
    known = torch.ones(height, width, dtype=torch.bool)
    known[height // 4 : height // 2, width // 4 : width // 2] = False
    return known


@pytest.mark.parametrize("size", [(8, 16), (9, 13), (1, 1), (20, 7)])
def test_the_network_gets_whole_cells_with_an_unknown_margin(size: tuple[int, int]) -> None:
    painter, rgb, known = Painter(), random_rgb(*size), hole(*size)
    known[0, 0] = False
    found = NetworkInpainting(network=painter)(rgb, known)
    assert found.shape == rgb.shape and torch.equal(found[known], rgb[known])
    assert all(side % 8 == 0 for side in painter.known.shape[1:])
    assert int(painter.known.sum()) == int(known.sum())
    top = (-size[0] % 8) // 2
    torch.testing.assert_close(found[0, 0], torch.full((3,), top / 1000))


def test_unknown_colours_are_not_passed_on() -> None:
    painter, known = Painter(), hole(8, 8)
    rgb = torch.where(known[..., None], random_rgb(8, 8), torch.nan)
    found = NetworkInpainting(network=painter)(rgb, known)
    assert bool(found.isfinite().all()) and bool(painter.image.isfinite().all())


def test_what_is_known_everywhere_needs_no_network() -> None:
    painter, rgb = Painter(), random_rgb(8, 8)
    assert NetworkInpainting(network=painter)(rgb, torch.ones(8, 8, dtype=torch.bool)) is rgb
    assert not painter.known.numel()


def test_the_network_runs_in_one_thread() -> None:
    """So that a scene has the same bits on any number of cores."""
    before, painter = torch.get_num_threads(), Painter()
    torch.set_num_threads(2)
    NetworkInpainting(network=painter)(random_rgb(8, 8), hole(8, 8))
    assert (painter.threads, torch.get_num_threads()) == (1, 2)
    torch.set_num_threads(before)


def test_large_images_are_seen_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inpainting, "MOST_SIDE_PX", 16)
    painter, rgb, known = Painter(), random_rgb(32, 48), hole(32, 48)
    found = NetworkInpainting(network=painter)(rgb, known)
    assert painter.image.shape[2:] == (16, 16)
    # Of 11 × 16 cells in the middle, those that hold an unknown pixel are unknown.
    assert not bool(painter.known[:, :2].any()) and 0 < int(painter.known.sum()) < 11 * 16
    assert found.shape == rgb.shape and torch.equal(found[known], rgb[known])


def test_a_copy_is_inpainted_and_enlarged() -> None:
    painter, rgb, known = Painter(), random_rgb(32, 48), hole(32, 48)
    network = NetworkInpainting(network=painter)
    found = on_copy(network, 24)(rgb, known)
    assert painter.image.shape[2:] == (16, 24)
    assert torch.equal(found[known], rgb[known])
    assert bool((found[10:14, 16:20] < 0.1).all()), "far enough from what is known"
    assert torch.equal(on_copy(network, 48)(rgb, known), network(rgb, known))


def test_a_cell_with_one_unknown_pixel_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inpainting, "MOST_SIDE_PX", 16)
    painter, known = Painter(), torch.ones(32, 32, dtype=torch.bool)
    known[10, 20] = False
    NetworkInpainting(network=painter)(random_rgb(32, 32), known)
    assert (~painter.known[0]).nonzero().tolist() == [[5, 10]]


class Tinter:
    """A network that paints orange."""

    multiple_px = 8

    def __call__(self, image: Tensor, known: Tensor) -> Tensor:
        orange = torch.tensor([0.9, 0.5, 0.1])[:, None, None]
        return torch.where(known[:, None], image, orange)


@pytest.mark.parametrize("is_grey", [True, False])
def test_a_photograph_without_colours_stays_one(is_grey: bool) -> None:
    rgb, known = random_rgb(16, 16), hole(16, 16)
    rgb = rgb.mean(-1, keepdim=True).expand_as(rgb) if is_grey else rgb
    painted = NetworkInpainting(network=Tinter())(rgb, known)[~known]
    wanted = torch.full((3,), 0.5) if is_grey else torch.tensor([0.9, 0.5, 0.1])
    torch.testing.assert_close(painted, wanted.expand_as(painted))
