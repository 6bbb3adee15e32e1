"""Pipes, devices and impossible names are refused at the door, without waiting."""

import os
from pathlib import Path

import pytest

from diff4splat.configs.recipes import find_recipe
from diff4splat.data_prep.readers.registry import detect_format
from diff4splat.errors import (
    ConfigError,
    Diff4SplatError,
    FileFormatError,
    InputError,
    OutputError,
)
from diff4splat.geometry.camera import pinhole
from diff4splat.io.cameras.path_files import read_path
from diff4splat.io.photos.images import read_photo
from diff4splat.io.require_file import (
    is_file,
    opened_file,
    read_bytes,
    read_text,
    require_file,
    require_writable,
)
from diff4splat.training.trainer.logs.run_files import EventLog

ODD_NAMES = ("x" * 300, "y" * 5000, "a\0b", "\udcff" * 200)


@pytest.fixture
def pipe(tmp_path: Path) -> Path:
    os.mkfifo(tmp_path / "pipe.json")
    return tmp_path / "pipe.json"


def test_a_pipe_is_refused_at_once(pipe: Path) -> None:
    with pytest.raises(FileFormatError, match="got a device; give the file itself"):
        require_file(pipe, "a test file")
    with pytest.raises(InputError, match="got a device"):
        read_bytes(pipe, "a test file", InputError)
    with pytest.raises(ConfigError, match="got a device"):
        find_recipe(str(pipe))
    with pytest.raises(InputError, match="got a device"):
        read_path(pipe, pinhole(10.0, (8, 8)))
    with pytest.raises(InputError, match="got a device"):
        read_photo(pipe)


def test_logs_are_not_written_into_pipes(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "log.jsonl")
    with pytest.raises(OutputError, match="a pipe or a device stands there"):
        EventLog(tmp_path)
    require_writable(tmp_path / "new")
    with pytest.raises(OutputError, match="a pipe or a device stands there"):
        require_writable(Path("/dev/null"))


def test_folders_with_pipes_are_no_captures(tmp_path: Path) -> None:
    for name in ("camera.json", "dataset.json", "transforms.json", "manifest.json"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="expected a capture, got none of these"):
        detect_format(tmp_path)


def test_a_device_that_never_ends_is_refused(tmp_path: Path) -> None:
    (tmp_path / "zero.json").symlink_to("/dev/zero")
    for read in (read_bytes, read_text, require_file):
        with pytest.raises(FileFormatError, match="got a device"):
            read(tmp_path / "zero.json", "a test file")


@pytest.mark.parametrize("name", ODD_NAMES)
def test_names_that_no_file_can_have(tmp_path: Path, name: str) -> None:
    assert not is_file(tmp_path / name)
    with pytest.raises(Diff4SplatError, match="expected a test file, got") as caught:
        require_file(tmp_path / name, "a test file")
    assert len(str(caught.value)) < 400


def test_contents_come_whole_or_not_at_all(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"\xef\xbb\xbf{}")
    assert read_bytes(file, "a test file") == b"\xef\xbb\xbf{}"
    assert read_text(file, "a test file") == "{}"
    assert read_bytes(file, "a test file", max_bytes=5)
    with pytest.raises(FileFormatError, match="of at most 0 MiB, got more"):
        read_bytes(file, "a test file", max_bytes=4)
    file.write_bytes(b"\xff")
    with pytest.raises(FileFormatError, match="text in UTF-8, got other data"):
        read_text(file, "a test file")
    file.write_bytes(b"")
    with pytest.raises(FileFormatError, match="an empty file"):
        read_text(file, "a test file")
    with pytest.raises(FileFormatError, match="got a folder"):
        read_bytes(tmp_path, "a test file")


def test_no_memory_for_bytes_that_are_not_there(tmp_path: Path) -> None:
    """A chunk of a PNG that promises gigabytes: the buffer for them would be taken first."""
    (tmp_path / "a").write_bytes(bytes(range(100)))
    with opened_file(tmp_path / "a", "a test file") as stream:
        assert stream.read(3) == b"\0\1\2"
        assert stream.read(1 << 50) == bytes(range(3, 100))
        assert stream.read(1 << 50) == b""
        stream.seek(98)
        assert stream.read() == b"bc"
        stream.seek(1000)
        assert stream.read(5) == b""
