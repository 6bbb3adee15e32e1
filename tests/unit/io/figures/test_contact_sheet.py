"""The preview page: everything is on it, nothing is cut off, and depth has honest colours."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch

from diff4splat.errors import InputError, ShapeError
from diff4splat.io.figures import fonts
from diff4splat.io.figures.contact_sheet import SheetContent, contact_sheet
from diff4splat.io.figures.depth_colors import color_bar, colorize, robust_range
from diff4splat.io.figures.page_layout import BACKGROUND, NOTE_PAPER, Style, text_width, wrap


def content(frames: int = 6, height: int = 30, width: int = 40, **more: object) -> SheetContent:
    """Frames of pure red, a photograph of pure green."""
    red = torch.zeros(frames, height, width, 3)
    red[..., 0] = 1
    green = torch.zeros(24, 36, 3)
    green[..., 1] = 1
    depth = torch.linspace(1, 5, frames * height * width).reshape(frames, height, width)
    plain = SheetContent(photo=green, frames=red, depth=depth, times_s=torch.linspace(0, 2, frames))
    return replace(plain, **more)


def pixels_of(sheet: torch.Tensor, color: tuple[int, int, int]) -> torch.Tensor:
    """Where the page has exactly this colour."""
    return ((sheet * 255).round() == torch.tensor(color)).all(-1)


def runs(mask: torch.Tensor) -> int:
    """Number of separate stretches along one row."""
    return int((mask.int().diff(prepend=torch.zeros(1, dtype=torch.int)) == 1).sum())


@pytest.mark.parametrize(("frames", "shown"), [(1, 1), (2, 2), (5, 5), (6, 5), (49, 5)])
def test_photograph_and_frames_are_there(frames: int, shown: int) -> None:
    sheet = contact_sheet(content(frames))
    green, red = pixels_of(sheet, (0, 255, 0)), pixels_of(sheet, (255, 0, 0))
    assert bool(green.any())
    busiest = red.sum(1).argmax()
    assert runs(red[busiest]) == shown


@pytest.mark.parametrize("size", [(30, 40), (300, 4), (4, 300), (1, 1)])
@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("note", [None, "untrained: the photograph itself on a plane"])
def test_nothing_touches_the_margin(size: tuple[int, int], alpha: bool, note: str | None) -> None:
    page = content(5, *size, note=note, facts=(("Prompt", "word " * 60), ("Seed", "x" * 300)))
    page = replace(page, alpha=torch.ones(5, *size) if alpha else None)
    sheet = contact_sheet(page)
    empty = pixels_of(sheet, BACKGROUND)
    border = 38
    assert bool(empty[:border].all() and empty[-border:].all()), "drawn into the margin"
    assert bool(empty[:, :border].all() and empty[:, -border:].all()), "drawn into the margin"
    assert bool(pixels_of(sheet, NOTE_PAPER).any()) == (note is not None)


def test_a_row_more_for_coverage_and_the_same_image_every_time() -> None:
    page = content(5)
    plain, covered = contact_sheet(page), contact_sheet(replace(page, alpha=torch.ones(5, 30, 40)))
    assert covered.shape[0] > plain.shape[0]
    assert covered.shape[1] == plain.shape[1]
    assert torch.equal(contact_sheet(page), plain)
    assert plain.dtype == torch.float32


def test_a_longer_note_makes_a_longer_page() -> None:
    short = contact_sheet(content(note="untrained"))
    long = contact_sheet(content(note="untrained and so on " * 100))
    assert long.shape[0] > short.shape[0]


@pytest.mark.parametrize("depth", [0.0, -1.0, float("nan"), float("inf"), 2.0])
def test_depth_without_a_range(depth: float) -> None:
    sheet = contact_sheet(content(depth=torch.full((6, 30, 40), depth)))
    assert bool(torch.isfinite(sheet).all())


def test_no_frames() -> None:
    with pytest.raises(InputError, match="contact sheet: expected at least one frame"):
        contact_sheet(content(0))


@pytest.mark.parametrize("name", ["depth", "times_s", "alpha"])
def test_parts_that_do_not_belong_together(name: str, as_shipped: None) -> None:
    other = torch.zeros(5) if name == "times_s" else torch.zeros(6, 30, 41)
    with pytest.raises(ShapeError, match=rf"contact sheet {name}: expected \(6, 30, 40\)"):
        contact_sheet(content(**{name: other}))


def test_the_range_ignores_strays_and_gaps() -> None:
    depth = torch.linspace(1, 2, 1000)
    depth[::100] = 0
    depth[5], depth[6], depth[7] = 1e9, float("nan"), float("inf")
    low, high = robust_range(depth)
    assert 1 < low < 1.05
    assert 1.95 < high < 2
    want = np.quantile(np.linspace(1, 2, 101), [0.02, 0.98])
    assert robust_range(torch.linspace(1, 2, 101)) == pytest.approx(tuple(want))
    assert robust_range(torch.zeros(3)) is None
    assert robust_range(torch.zeros(0)) is None


def test_near_is_warm_far_is_cold_and_nothing_is_grey() -> None:
    got = colorize(torch.tensor([[1.0, 3.0, 1.5, 0.0, 9.0, 0.5]]), (1.0, 3.0))[0]
    table = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_TURBO)
    turbo = torch.from_numpy(table[:, 0, ::-1] / 255).float()
    torch.testing.assert_close(got[0], turbo[255])
    torch.testing.assert_close(got[1], turbo[0])
    torch.testing.assert_close(got[2], turbo[128])
    assert got[3].tolist() == pytest.approx([0.16] * 3)
    torch.testing.assert_close(got[4], turbo[0])
    torch.testing.assert_close(got[5], turbo[255])
    assert got[0, 0] > got[0, 2], "near is not warm"
    torch.testing.assert_close(color_bar(9, 2)[1, 0], turbo[255])
    torch.testing.assert_close(color_bar(9, 2)[1, -1], turbo[0])


@pytest.mark.parametrize(
    "text", ["", "word", "two words", "x" * 500, "a " * 300, "long" * 9 + " b"]
)
@pytest.mark.parametrize("width", [20, 200])
def test_wrapped_lines_fit_and_lose_nothing(text: str, width: int) -> None:
    lines = wrap(text, Style(size_px=16), width)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert all(text_width(line, Style(size_px=16)) <= width for line in lines)


def test_a_far_sky_leaves_colours_to_what_is_near() -> None:
    depth = torch.cat([torch.linspace(2, 6, 500), torch.full((500,), 400.0)])[None]
    near = colorize(depth, robust_range(depth))[0, :500]
    levels = (near * 255).round().long().unique(dim=0)
    assert len(levels) > 150, "a linear map leaves three"
    bar = color_bar(9, 2, (2.0, 400.0))[0]
    at_middle = torch.tensor([[2 / (1 / 2.0 + 1 / 400.0)]])
    torch.testing.assert_close(bar[4], colorize(at_middle, (2.0, 400.0))[0, 0], atol=0.02, rtol=0)


def test_noise_of_flat_depth_is_no_shape() -> None:
    depth = 4 + 0.01 * torch.rand(20, 30)
    assert len(colorize(depth, robust_range(depth)).reshape(-1, 3).unique(dim=0)) == 1
    assert len(colorize(4 * depth**8, robust_range(4 * depth**8)).reshape(-1, 3).unique(dim=0)) > 50


@pytest.mark.parametrize("text", ["猫が左へ歩く", "\U0001f697\U0001f44d", "\u05d0\u0e01"])
def test_characters_without_a_font_are_visible_boxes(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fonts, "_font_files", lambda: ())
    for cached in (fonts.fonts, fonts._system_fonts, fonts._font_of):
        cached.cache_clear()
    page = contact_sheet(content(facts=(("Prompt", text),)))
    plain = contact_sheet(content(facts=(("Prompt", " "),)))
    assert int((page != plain).any(-1).sum()) > 30 * len(text)
    assert text_width(text, Style()) >= 10 * len(text)
    assert all(font is None for font, _ in fonts.runs(text, 20))
    for cached in (fonts.fonts, fonts._system_fonts, fonts._font_of):
        cached.cache_clear()


def test_joined_emoji_are_no_boxes_for_their_joints() -> None:
    parts = "".join(part for _, part in fonts.runs("a\u200db\ufe0f", 20))
    assert parts == "ab"
