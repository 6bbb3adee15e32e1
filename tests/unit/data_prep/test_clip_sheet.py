"""The contact sheet: two frames per clip, rows of eight, whatever the sizes."""

from pathlib import Path

import pytest
import torch
from clip_shards import exact_clip, write_shards
from oracles_clips import make_clip
from PIL import Image

from diff4splat.data_prep.clip_sheet import GAP_PX, MOST_CLIPS, clip_sheet, write_clip_sheet
from diff4splat.errors import FileFormatError

TILE = (32 + GAP_PX, 2 * 32 + GAP_PX)


@pytest.mark.parametrize(("count", "rows", "columns"), [(1, 1, 1), (3, 1, 3), (8, 1, 8), (9, 2, 8)])
def test_rows_of_eight(count: int, rows: int, columns: int) -> None:
    sheet = clip_sheet([exact_clip(0, True)] * count)
    assert sheet.shape == (rows * TILE[0], columns * TILE[1], 3)
    assert bool(((sheet >= 0) & (sheet <= 1)).all())


def test_a_tile_is_the_first_and_the_last_frame_on_white() -> None:
    clip = exact_clip(0, False)
    sheet, rgb = clip_sheet([clip] * 9), clip.views[0].rgb.float() / 255
    assert torch.equal(sheet[:32, :32], rgb[0])
    assert torch.equal(sheet[:32, 32:64], rgb[-1])
    assert bool((sheet[32:36] == 1).all()) and bool((sheet[:, 64:68] == 1).all())
    assert bool((sheet[36:, TILE[1] :] == 1).all())  # one clip in the second row


def test_clips_of_several_sizes_share_a_sheet() -> None:
    small, large = exact_clip(0, True), make_clip(5, (40, 48), seed=1)
    sheet = clip_sheet([small, large])
    assert sheet.shape == (40 + GAP_PX, 2 * (2 * 48 + GAP_PX), 3)
    assert torch.equal(sheet[:32, :32], small.views[0].rgb[0].float() / 255)
    left = 2 * 48 + GAP_PX
    assert torch.equal(sheet[:40, left : left + 48], large.views[0].rgb[0].float() / 255)
    assert bool((sheet[36:, :left] == 1).all())


def test_a_folder_becomes_an_image(tmp_path: Path) -> None:
    folder = write_shards(tmp_path / "shards", still=1, moving=1)
    write_clip_sheet(folder, tmp_path / "clips.png")
    with Image.open(tmp_path / "clips.png") as image:
        assert image.size == (2 * TILE[1], TILE[0])


def test_large_folders_are_sampled_evenly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_shards(tmp_path / "shards", still=3, moving=2)
    monkeypatch.setattr("diff4splat.data_prep.clip_sheet.MOST_CLIPS", 3)
    assert MOST_CLIPS == 64
    write_clip_sheet(folder, tmp_path / "clips.png")
    with Image.open(tmp_path / "clips.png") as image:
        assert image.size == (3 * TILE[1], TILE[0])


def test_a_folder_without_clips_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"manifest\.json"):
        write_clip_sheet(tmp_path, tmp_path / "clips.png")
    assert not (tmp_path / "clips.png").exists()
