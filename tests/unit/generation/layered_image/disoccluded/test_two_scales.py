"""What a network inpaints alike at two scales."""

import pytest
import torch
from torch import Tensor

from diff4splat.generation.layered_image.disoccluded import two_scales
from diff4splat.generation.layered_image.disoccluded.two_scales import agreeing_scales
from diff4splat.generation.layered_image.inpainting import Inpaint

SIDE = 48
RGB = torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0))
KNOWN = torch.ones(SIDE, SIDE, dtype=torch.bool)
KNOWN[8:40, 12:36] = False
STRIPES = 0.2 * (torch.arange(SIDE) % 2).float()[:, None] - 0.1


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(two_scales, "COARSE_PX", SIDE // 2)
    monkeypatch.setattr(two_scales, "LEAST_SIDE_PX", SIDE)


def paint(fine: float, coarse: float) -> Inpaint:
    """One colour at each scale, with stripes at the finer one."""

    def inpaint(rgb: Tensor, known: Tensor) -> Tensor:
        value = fine + STRIPES if len(rgb) == SIDE else torch.full((), coarse)
        return torch.where(known[..., None], rgb, value.expand(known.shape)[..., None])

    return inpaint


def test_where_scales_agree_the_finer_one_stays() -> None:
    found = agreeing_scales(paint(0.5, 0.5))(RGB, KNOWN)
    expected = paint(0.5, 0.5)(RGB, KNOWN)
    torch.testing.assert_close(found, expected, atol=0.02, rtol=0)


def test_where_they_do_not_the_coarser_one_does() -> None:
    found = agreeing_scales(paint(0.9, 0.3))(RGB, KNOWN)
    assert torch.equal(found[KNOWN], RGB[KNOWN])
    middle = found[16:32, 18:30]
    torch.testing.assert_close(middle, torch.full_like(middle, 0.3), atol=1e-3, rtol=0)


def test_a_small_difference_is_a_mean_of_both() -> None:
    middle = agreeing_scales(paint(0.55, 0.5))(RGB, KNOWN)[16:32, 18:30]
    assert 0.5 < float(middle.mean()) < 0.55


@pytest.mark.parametrize("case", ["all known", "a small image"])
def test_there_is_no_other_scale(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    known, calls = torch.ones_like(KNOWN) if case == "all known" else KNOWN, []
    if case != "all known":
        monkeypatch.setattr(two_scales, "LEAST_SIDE_PX", SIDE + 1)

    def inpaint(rgb: Tensor, known: Tensor) -> Tensor:
        calls.append(known)
        return rgb

    assert agreeing_scales(inpaint)(RGB, known) is RGB
    assert len(calls) == 1


@pytest.mark.parametrize("size", [(1, 1), (1, 60), (49, 2)])
def test_thin_images_and_nothing_known_are_finite(size: tuple[int, int]) -> None:
    def grey(rgb: Tensor, known: Tensor) -> Tensor:
        return torch.where(known[..., None], rgb, 0.5)

    found = agreeing_scales(grey)(torch.rand(*size, 3), torch.zeros(size, dtype=torch.bool))
    torch.testing.assert_close(found, torch.full((*size, 3), 0.5))
