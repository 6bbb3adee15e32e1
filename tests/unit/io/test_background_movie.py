"""A movie in the background: the same bytes, and nothing where the work fails."""

import errno
from pathlib import Path

import pytest
import torch

from diff4splat.errors import OutputError
from diff4splat.io import video as video_module
from diff4splat.io.movies.background_movie import BackgroundMovie
from diff4splat.io.video import write_video


def test_the_same_bytes(tmp_path: Path) -> None:
    frames = torch.rand(5, 20, 31, 3)
    plain = write_video(frames, tmp_path / "plain.webm", 12.0)
    with BackgroundMovie(tmp_path / "background.webm", 12.0) as movie:
        for frame in frames:
            movie.add(frame)
        assert movie.finish() == plain.notes
    files = [(tmp_path / name).read_bytes() for name in ("plain.webm", "background.webm")]
    assert files[0] == files[1]


@pytest.mark.parametrize("count", [0, 2])
def test_a_failure_leaves_nothing(count: int, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), BackgroundMovie(tmp_path / "a.webm", 12.0) as movie:
        for _ in range(count):
            movie.add(torch.rand(6, 8, 3))
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_writer_that_fails_is_heard_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(video_module, "_write_all", full)
    with BackgroundMovie(tmp_path / "a.webm", 12.0) as movie:
        movie.add(torch.rand(6, 8, 3))
        with pytest.raises(OutputError, match="the disk is full"):
            movie.finish()
    assert list(tmp_path.iterdir()) == []
