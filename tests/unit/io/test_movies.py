"""Moving images in every format: what goes in can be seen coming out."""

import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from diff4splat.errors import ConfigError, InputError, OutputError, ShapeError
from diff4splat.io.movies import h264, movie
from diff4splat.io.movies.movie import NOT_H264, default_suffix, write_movie
from diff4splat.io.movies.suffixes import is_movie
from diff4splat.io.photos.images import read_photo

FAKE_FFMPEG = """#!{python}
import sys
import cv2, numpy as np
if "-encoders" in sys.argv:
    print(" V....D libx264              libx264 H.264")
    sys.exit(0)
if {fails}:
    sys.exit("Unknown encoder")
width, height = map(int, sys.argv[sys.argv.index("-s") + 1].split("x"))
fps = float(sys.argv[sys.argv.index("-r") + 1])
code = cv2.VideoWriter.fourcc(*"mp4v")
writer = cv2.VideoWriter(sys.argv[-1], cv2.CAP_FFMPEG, code, fps, (width, height))
while frame := sys.stdin.buffer.read(width * height * 3):
    rgb = np.frombuffer(frame, np.uint8).reshape(height, width, 3)
    writer.write(np.ascontiguousarray(rgb[..., ::-1]))
writer.release()
"""


@pytest.fixture(autouse=True)
def _no_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As on a machine without ffmpeg, unless a test installs one."""
    monkeypatch.setattr(h264.shutil, "which", lambda name: None)
    h264.h264_encoder.cache_clear()
    yield
    h264.h264_encoder.cache_clear()


def install(monkeypatch: pytest.MonkeyPatch, folder: Path, fails: bool = False) -> None:
    program = folder / "ffmpeg"
    program.write_text(FAKE_FFMPEG.format(python=sys.executable, fails=fails))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(h264.shutil, "which", lambda name: str(program))
    h264.h264_encoder.cache_clear()


def frames(count: int = 4, height: int = 16, width: int = 24) -> Iterator[torch.Tensor]:
    for step in torch.linspace(0.1, 0.9, count):
        yield torch.stack([step, 1 - step, torch.tensor(0.25)]).expand(height, width, 3)


def animation(file: Path) -> np.ndarray:
    with Image.open(file) as image:
        shown = []
        for index in range(image.n_frames):
            image.seek(index)
            shown.append(np.asarray(image.convert("RGB")) / 255)
    return np.stack(shown)


@pytest.mark.parametrize("name", ["view.gif", "view.webp", "view.GIF"])
def test_animations_hold_every_frame_and_repeat(name: str, tmp_path: Path) -> None:
    steps = []
    notes = write_movie(frames(), tmp_path / name, 12.5, lambda: steps.append(1))
    got = animation(tmp_path / name)
    assert got.shape == (4, 16, 24, 3)
    assert np.abs(got - torch.stack(list(frames())).numpy()).max() < 0.03
    with Image.open(tmp_path / name) as image:
        image.load()
        assert image.info["duration"] == 80
        assert image.info["loop"] == 0
    assert len(steps) == 4
    assert bool(notes) == name.lower().endswith(".gif")


def test_numbered_images_appear_together(tmp_path: Path) -> None:
    write_movie(frames(), tmp_path / "shots" / "view_%04d.png", 24.0)
    names = sorted(file.name for file in (tmp_path / "shots").iterdir())
    assert names == [f"view_{index:04d}.png" for index in range(4)]
    rgb = read_photo(tmp_path / "shots" / "view_0003.png").rgb
    torch.testing.assert_close(rgb, list(frames())[3].float(), atol=0.003, rtol=0)

    def broken() -> Iterator[torch.Tensor]:
        yield from frames(2)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_movie(broken(), tmp_path / "half" / "%d.png", 24.0)
    assert not (tmp_path / "half").exists()


@pytest.mark.parametrize("name", ["%s.png", "%d%d.png", "100%.png", "%99999999999d.png"])
def test_names_that_do_not_count_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises((ConfigError, OutputError)):
        write_movie(frames(), tmp_path / name, 24.0)
    assert list(tmp_path.iterdir()) == []


def test_without_ffmpeg_videos_are_vp9(tmp_path: Path) -> None:
    assert default_suffix() == ".webm"
    assert write_movie(frames(), tmp_path / "a.webm", 24.0) == ()
    assert write_movie(frames(), tmp_path / "a.mp4", 24.0) == (NOT_H264,)
    assert b"webm" in (tmp_path / "a.webm").read_bytes()[:64]
    with pytest.raises(OutputError, match="install ffmpeg"):
        h264.write_h264(frames(), tmp_path / "b.mp4", 24.0, lambda: None)


def test_with_ffmpeg_mp4_is_written_by_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, tmp_path)
    out = tmp_path / "out"
    assert default_suffix() == ".mp4"
    assert movie.write_movie(frames(5), out / "a.mp4", 24.0) == ()
    assert write_movie(frames(2, 15, 23), out / "odd.mp4", 24.0) == (
        "padded from 23x15 to 24x16, since video needs even sizes",
    )
    assert sorted(os.listdir(out)) == ["a.mp4", "odd.mp4"]


def test_an_encoder_that_fails_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, tmp_path, fails=True)
    with pytest.raises(OutputError, match=r"ffmpeg, got: Unknown encoder; use \.webm"):
        write_movie(frames(5), tmp_path / "out" / "a.mp4", 24.0)
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "a.gif", "a.webp", "%d.png"])
def test_bad_frames_leave_nothing(name: str, tmp_path: Path) -> None:
    file = tmp_path / "out" / name
    assert is_movie(file)
    with pytest.raises(InputError, match="at least one frame"):
        write_movie(iter(()), file, 24.0)
    with pytest.raises(ShapeError, match="frame 1"):
        write_movie(iter([torch.rand(8, 8, 3), torch.rand(8, 9, 3)]), file, 24.0)
    with pytest.raises(ConfigError, match="fps"):
        write_movie(frames(), file, float("nan"))
    assert not file.parent.exists() or list(file.parent.iterdir()) == []


@pytest.mark.parametrize("name", ["a.avi", "a", "a.png", "a.exr"])
def test_other_names_are_no_movies(name: str) -> None:
    assert not is_movie(Path(name))
