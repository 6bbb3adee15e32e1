"""Cutouts of a folder as squares."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from diff4splat.errors import FileFormatError, InputError
from diff4splat.training.batches.random_images import cutouts
from diff4splat.training.batches.random_images.cutouts import SIDE_PX, read_cutouts


def write_cutout(file: Path, shape: tuple[int, int]) -> None:
    pixels = np.zeros((shape[0] + 8, shape[1] + 8, 4), np.uint8)
    pixels[4:-4, 4:-4] = (0, 0, 255, 255)
    pixels[-6:-4, 4:-4] = (0, 255, 0, 255)
    cv2.imwrite(str(file), pixels)


def test_objects_are_read_onto_the_lower_edge(tmp_path: Path) -> None:
    write_cutout(tmp_path / "a.png", (30, 60))
    (tmp_path / "more").mkdir()
    write_cutout(tmp_path / "more" / "b.png", (60, 15))
    wide, tall = read_cutouts(tmp_path)
    assert wide.shape == (4, SIDE_PX, SIDE_PX)
    opaque = [cutout[3] > 127 for cutout in (wide, tall)]
    assert bool(opaque[0][-1].all()) and not bool(opaque[0][: SIDE_PX // 2 - 2].any())
    assert bool(opaque[1][:, SIDE_PX // 2].all()) and not bool(opaque[1][:, : SIDE_PX // 4].any())
    for cutout in (wide, tall):
        middle = cutout[:3, :, SIDE_PX // 2]
        assert middle[:, -1].tolist() == [0, 255, 0]
        assert middle[:, -SIDE_PX // 4].tolist() == [255, 0, 0]


def test_a_folder_without_cutouts_or_with_damaged_ones_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=re.escape("data.cutouts")):
        read_cutouts(tmp_path)
    (tmp_path / "a.png").write_bytes(b"no image")
    with pytest.raises(FileFormatError, match="transparency"):
        read_cutouts(tmp_path)


def test_of_too_many_some_are_read_evenly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cutouts, "MOST_CUTOUTS", 2)
    for number in range(5):
        write_cutout(tmp_path / f"{number}.png", (20, 8 + 10 * number))
    read = cutouts.read_cutouts(tmp_path)
    widths = (read[:, 3] > 127).any(1).sum(1)
    assert len(read) == 2 and widths[1] > 2 * widths[0]
