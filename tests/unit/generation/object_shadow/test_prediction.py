"""Darkening of an image by a network: on its pixels, on the object, never beyond white."""

from dataclasses import dataclass, field

import pytest
import torch

from diff4splat.generation.object_shadow.prediction import (
    LEAST_DARKENING,
    LEAST_PEAK,
    MOST_DARKENING,
    SIDE_PX,
    enlarged_along,
    is_shadow,
    no_brighter_than_around,
    predicted_darkening,
)
from diff4splat.generation.object_shadow.shadow import (
    ObjectShadow,
    without_shadows,
)


@dataclass
class Fake:
    """The same darkening everywhere, or that of a function of the mask."""

    value: float = 0.5
    seen: list = field(default_factory=list)

    def __call__(self, image: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        self.seen.append((image, mask))
        return torch.where(mask[:, None] > 0.5, -3.0, self.value).expand(-1, 3, -1, -1)


def mask(side: int = 64) -> torch.Tensor:
    pixels = torch.zeros(side, side, dtype=torch.bool)
    pixels[20:40, 20:40] = True
    return pixels


@pytest.mark.parametrize("size", [(64, 64), (48, 96), (512, 320)])
def test_the_network_sees_a_copy_of_one_size(size: tuple[int, int]) -> None:
    fake = Fake()
    found = predicted_darkening(fake, torch.full((*size, 3), 0.3), mask())
    image, seen = fake.seen[0]
    assert found.shape == (*size, 3)
    assert max(image.shape[2:]) == SIDE_PX and image.shape[2:] == seen.shape[1:]
    assert all(side % 16 == 0 for side in image.shape[2:])


def test_the_object_has_the_shadow_of_its_outline() -> None:
    found = predicted_darkening(Fake(0.5), torch.full((64, 64, 3), 0.3), mask())
    assert torch.allclose(found, torch.full_like(found, 0.5), atol=1e-5)


def test_no_pixel_becomes_brighter_than_white() -> None:
    rgb = torch.rand(64, 64, 3)
    found = predicted_darkening(Fake(2.0), rgb, mask())
    assert float((rgb * found.exp()).max()) <= 1 + 1e-5


@pytest.mark.parametrize("value", [-1.0, 0.0, LEAST_DARKENING / 2])
def test_next_to_nothing_is_no_shadow(value: float) -> None:
    assert not predicted_darkening(Fake(value), torch.full((64, 64, 3), 0.3), mask()).any()


def test_no_prediction_makes_what_is_dark_glow() -> None:
    found = predicted_darkening(Fake(5.0), torch.full((64, 64, 3), 0.05), mask())
    assert float(found.max()) == pytest.approx(MOST_DARKENING)


def test_a_shadow_is_clearly_dark_somewhere() -> None:
    darkening = torch.zeros(20, 30, 3)
    darkening[2:8, 2:8], darkening[2:8, 20:26] = 2 * LEAST_DARKENING, 2 * LEAST_DARKENING
    darkening[4, 4, 1] = LEAST_PEAK
    wanted = torch.zeros(20, 30, dtype=torch.bool)
    wanted[2:8, 2:8] = True
    assert torch.equal(is_shadow(darkening), wanted)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_black_and_white_images_and_full_and_empty_masks(level: float) -> None:
    for pixels in (torch.zeros(64, 64, dtype=torch.bool), torch.ones(64, 64, dtype=torch.bool)):
        found = predicted_darkening(Fake(0.5), torch.full((64, 64, 3), level), pixels)
        assert bool(found.isfinite().all()) and bool((found >= 0).all())


def test_the_edge_of_a_shadow_does_not_shine() -> None:
    rgb = torch.full((3, 48, 48), 0.6)
    rgb[:, 16:32, 16:32] = 0.3
    found = torch.zeros(3, 48, 48)
    found[:, 13:35, 13:35] = 0.6
    bounded = no_brighter_than_around(found, rgb, torch.zeros(48, 48))
    assert torch.equal(bounded[:, 18:30, 18:30], found[:, 18:30, 18:30])
    assert float(bounded[:, 13, 13:35].max()) < 1e-5
    assert bool((bounded <= found).all())


def test_where_nothing_around_is_lit_nothing_is_bounded() -> None:
    found = torch.full((3, 48, 48), 0.6)
    for mask in (torch.zeros(48, 48), torch.ones(48, 48)):
        assert torch.equal(no_brighter_than_around(found, torch.rand(3, 48, 48), mask), found)


def test_a_guide_sharpens_the_edge_of_a_shadow() -> None:
    true = torch.zeros(1, 64, 64)
    true[..., 34:] = 0.7
    copy = torch.nn.functional.avg_pool2d(true, 4)
    smooth = torch.nn.functional.interpolate(copy[None], (64, 64), mode="bilinear")[0]
    sharp = enlarged_along(copy, -copy[0] - 1, -true[0] - 1)
    inner = slice(12, 52)
    left = [float((one - true)[..., inner].abs().mean()) for one in (sharp, smooth)]
    assert left[0] < 0.3 * left[1]


def test_a_guide_without_edges_changes_nothing_smooth() -> None:
    copy, guide = torch.full((3, 10, 10), 0.4), torch.full((10, 10), -1.0)
    found = enlarged_along(copy, guide, torch.full((40, 40), -1.0))
    assert torch.allclose(found, torch.full((3, 40, 40), 0.4), atol=1e-5)


def test_shadows_are_taken_off_and_add_up() -> None:
    seen = 0.1 + 0.3 * torch.rand(32, 32, 3)
    one = ObjectShadow(darkening=torch.full((32, 32, 3), 0.2), displacement=torch.zeros(2, 3))
    assert without_shadows(seen, []) is seen
    lit = without_shadows(seen, [one, one])
    assert torch.allclose(lit, seen * torch.tensor(0.4).exp())
    for copy in (seen[::4, ::4], seen.repeat(2, 2, 1)):
        assert torch.allclose(without_shadows(copy, [one]), copy * torch.tensor(0.2).exp())
