"""Videos: the frames that go in can be seen coming out, in order and in the right colours."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from diff4splat.errors import ConfigError, InputError, OutputError, ShapeError
from diff4splat.io import video
from diff4splat.io.video import write_video


def colours(frames: int, height: int, width: int) -> torch.Tensor:
    """Frames of one colour each: the green grows, red fades, blue stays."""
    steps = torch.linspace(0, 1, frames)
    rgb = torch.stack([1 - steps, steps, torch.full_like(steps, 0.25)], -1)
    return rgb[:, None, None].expand(frames, height, width, 3)


def decoded(file: Path) -> np.ndarray:
    """``t h w 3`` RGB levels, by OpenCV."""
    reader, frames = cv2.VideoCapture(str(file), cv2.CAP_FFMPEG), []
    while True:
        found, bgr = reader.read()
        if not found:
            return np.stack(frames)[..., ::-1]
        frames.append(bgr)


def rate(file: Path) -> float:
    return cv2.VideoCapture(str(file), cv2.CAP_FFMPEG).get(cv2.CAP_PROP_FPS)


def test_frames_come_out_in_order_and_colour(tmp_path: Path) -> None:
    want, steps = colours(6, 32, 48), []
    written = write_video(want, str(tmp_path / "a.mp4"), 12.5, lambda: steps.append(1))
    assert (written.frame_count, written.size_px, written.notes) == (6, (32, 48), ())
    assert len(steps) == 6
    got = decoded(tmp_path / "a.mp4")
    assert got.shape == (6, 32, 48, 3)
    assert np.abs(got / 255 - want.numpy()).max() < 0.06
    assert rate(tmp_path / "a.mp4") == pytest.approx(12.5)


def test_frames_may_come_one_by_one(tmp_path: Path) -> None:
    made = []

    def frames() -> object:
        for frame in colours(4, 16, 16):
            made.append(1)
            yield frame

    written = write_video(frames(), tmp_path / "a.mp4", 24.0, lambda: made.append(0))
    assert written.frame_count == 4
    assert made == [1, 0, 1, 0, 1, 0, 1, 0], "a frame is not held back"


@pytest.mark.parametrize(("height", "width"), [(33, 48), (32, 47), (33, 47), (1, 1), (2, 1)])
def test_odd_sizes_are_padded_and_said(tmp_path: Path, height: int, width: int) -> None:
    frames = colours(3, height, width)
    written = write_video(frames, tmp_path / "a.mp4", 24.0)
    even = (height + height % 2, width + width % 2)
    assert written.size_px == even
    assert written.notes == (
        f"padded from {width}x{height} to {even[1]}x{even[0]}, since video needs even sizes",
    )
    got = decoded(tmp_path / "a.mp4")
    assert got.shape == (3, *even, 3)
    assert np.abs(got[:, -1, -1] / 255 - frames[:, -1, -1].numpy()).max() < 0.06


@pytest.mark.parametrize("suffix", ["mp4", "webm"])
def test_equal_frames_give_equal_bytes(suffix: str, tmp_path: Path) -> None:
    frames = torch.rand(4, 32, 32, 3)
    files = [tmp_path / f"{name}.{suffix}" for name in "ab"]
    for file in files:
        write_video(frames, file, 24.0)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert decoded(files[0]).shape == (4, 32, 32, 3)


def test_values_beyond_the_range_are_clamped(tmp_path: Path) -> None:
    frames = torch.stack([torch.full((16, 16, 3), v) for v in (-5.0, 7.0, float("nan"))])
    write_video(frames, tmp_path / "a.mp4", 24.0)
    means = decoded(tmp_path / "a.mp4").mean((1, 2, 3))
    assert means == pytest.approx([0, 255, 0], abs=5), "white is about 251 after the codec"


def test_without_vp9_it_falls_back_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(video, "_CODECS", ("none", "mp4v"))
    written = write_video(colours(3, 32, 32), tmp_path / "a.mp4", 24.0)
    assert written.notes == (
        "written as MPEG-4, since VP9 is missing here; browsers may not play it",
    )
    assert len(decoded(tmp_path / "a.mp4")) == 3
    assert capfd.readouterr() == ("", "")


def test_without_any_codec_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(video, "_CODECS", ("none", "nope"))
    with pytest.raises(OutputError, match="install opencv-contrib-python-headless"):
        write_video(colours(3, 32, 32), tmp_path / "a.mp4", 24.0)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_frames_lost_without_a_word_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "_write_all", lambda *_: 5)
    with pytest.raises(OutputError, match="expected 5 frames in the finished video, got 0"):
        write_video(colours(5, 32, 32), tmp_path / "a.mp4", 24.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf")])
def test_frame_rates_that_are_none(tmp_path: Path, fps: float) -> None:
    with pytest.raises(ConfigError, match="fps: expected a number above 0"):
        write_video(colours(2, 16, 16), tmp_path / "a.mp4", fps)


@pytest.mark.parametrize("fps", [0.5, 23.976, 240.0])
def test_unusual_frame_rates(tmp_path: Path, fps: float) -> None:
    write_video(colours(3, 16, 16), tmp_path / "a.mp4", fps)
    assert rate(tmp_path / "a.mp4") == pytest.approx(fps, rel=1e-3)


def test_other_names_and_no_frames(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"expected a name ending in \.mp4 or \.webm, got '\.avi'"
    ):
        write_video(colours(2, 16, 16), tmp_path / "a.avi", 24.0)
    with pytest.raises(InputError, match="expected at least one frame"):
        write_video(iter([]), tmp_path / "a.mp4", 24.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("shape", [(16, 18, 3), (16, 16, 4), (16, 16)])
def test_frames_of_different_kinds(
    tmp_path: Path, shape: tuple[int, ...], as_shipped: None
) -> None:
    with pytest.raises(ShapeError, match=r"frame 1: expected \(height, width, 3\)"):
        write_video([torch.rand(16, 16, 3), torch.rand(shape)], tmp_path / "a.mp4", 24.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("shape", [(16,), (16, 16), (0, 16, 3)])
def test_a_first_frame_that_is_none(
    tmp_path: Path, shape: tuple[int, ...], as_shipped: None
) -> None:
    with pytest.raises(ShapeError, match=r"frame 0: expected \(height, width, 3\)"):
        write_video([torch.rand(shape)], tmp_path / "a.mp4", 24.0)
    assert list(tmp_path.iterdir()) == []
