"""Every writer leaves an existing file alone, and nothing behind, when it cannot finish."""

import errno
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import oracles_io
import pytest
import torch

from diff4splat.errors import OutputError
from diff4splat.io import exr
from diff4splat.io.exr import write_depth_exr
from diff4splat.io.photos.images import write_png
from diff4splat.io.ply.ply_file import write_ply, write_ply_sequence
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.io.video import write_video
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion

WRITERS: dict[str, Callable[[Path], object]] = {
    "image.png": lambda file: write_png(torch.rand(20, 20, 3), file),
    "scene.safetensors": lambda file: save_scene(oracles_io.scene(), file),
    "state.ply": lambda file: write_ply(oracles_io.gaussians(), file),
    "video.mp4": lambda file: write_video(torch.rand(3, 6, 8, 3), file, 12.0),
    "depth.exr": lambda file: write_depth_exr(torch.ones(2, 6, 8), oracles_io.camera_path(), file),
}


@pytest.fixture(params=list(WRITERS))
def target(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """An existing file that a writer is about to replace."""
    (tmp_path / request.param).write_text("precious")
    return tmp_path / request.param


def assert_untouched(target: Path) -> None:
    assert target.read_text() == "precious"
    assert list(target.parent.iterdir()) == [target]


def raising(error: BaseException) -> Callable[..., None]:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


def test_a_finished_write_replaces_and_leaves_nothing_else(
    target: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    WRITERS[target.name](target)
    assert target.stat().st_size > 50
    assert list(target.parent.iterdir()) == [target]
    assert capfd.readouterr() == ("", "")


def test_a_full_disk_at_the_last_moment(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "replace", raising(OSError(errno.ENOSPC, "No space left on device")))
    with pytest.raises(OutputError, match="the disk is full; free some space") as caught:
        WRITERS[target.name](target)
    assert str(target) in str(caught.value)
    assert_untouched(target)


def test_an_interrupt_at_the_last_moment(target: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "replace", raising(KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        WRITERS[target.name](target)
    assert_untouched(target)


@pytest.mark.parametrize("name", list(WRITERS))
def test_a_file_where_a_folder_is_needed(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("precious")
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        WRITERS[name](tmp_path / "file" / name)
    with pytest.raises(OutputError, match="a file stands where a folder is needed"):
        WRITERS[name](tmp_path / "file" / "deeper" / name)
    assert_untouched(tmp_path / "file")


@pytest.mark.parametrize("name", list(WRITERS))
def test_a_folder_where_the_file_should_go(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="a folder stands where the file should go"):
        WRITERS[name](tmp_path / name)
    assert list(tmp_path.iterdir()) == [tmp_path / name]
    assert list((tmp_path / name).iterdir()) == []


@pytest.mark.parametrize("name", list(WRITERS))
def test_missing_folders_are_made(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / "new" / "folder" / name)
    assert (tmp_path / "new" / "folder" / name).is_file()


@pytest.mark.parametrize("name", ["image.png", "state.ply"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "full")])
def test_trouble_in_the_middle_of_the_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, error: BaseException
) -> None:
    def half(file: Path, data: bytes) -> None:
        file.write_text(str(data[: len(data) // 2]))
        raise error

    (tmp_path / name).write_text("precious")
    monkeypatch.setattr(Path, "write_bytes", half)
    with pytest.raises((KeyboardInterrupt, OutputError)):
        WRITERS[name](tmp_path / name)
    assert_untouched(tmp_path / name)


def test_trouble_in_the_middle_of_a_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").write_text("precious")
    monkeypatch.setattr(
        "diff4splat.io.scene_files.tensor_file._header", raising(KeyboardInterrupt())
    )
    with pytest.raises(KeyboardInterrupt):
        save_scene(oracles_io.scene(), tmp_path / "a")
    assert_untouched(tmp_path / "a")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("renderer")])
def test_trouble_while_frames_are_still_made(tmp_path: Path, error: BaseException) -> None:
    def frames() -> Iterator[torch.Tensor]:
        yield torch.rand(6, 8, 3)
        raise error

    (tmp_path / "a.mp4").write_text("precious")
    with pytest.raises(type(error)):
        write_video(frames(), tmp_path / "a.mp4", 12.0)
    assert_untouched(tmp_path / "a.mp4")


def test_trouble_in_the_middle_of_depth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def half(parts: object, temporary: Path) -> None:
        temporary.write_text("half")
        raise KeyboardInterrupt

    (tmp_path / "a.exr").write_text("precious")
    monkeypatch.setattr(exr, "_write", half)
    with pytest.raises(KeyboardInterrupt):
        WRITERS["depth.exr"](tmp_path / "a.exr")
    assert_untouched(tmp_path / "a.exr")


class Breaking(StaticMotion):
    """A motion that fails on its second state."""

    def state_at(self, gaussians: Gaussians, time_s: float) -> Gaussians:
        if time_s > 0:
            raise KeyboardInterrupt
        return gaussians


def test_trouble_in_the_middle_of_a_sequence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "frames"
    broken = replace(oracles_io.scene(), motion=Breaking())
    with pytest.raises(KeyboardInterrupt):
        write_ply_sequence(broken, folder, [0.0, 1.0])
    assert list(tmp_path.iterdir()) == []
    folder.mkdir()
    (folder / "frame_0000.ply").write_text("precious")
    with pytest.raises(KeyboardInterrupt):
        write_ply_sequence(broken, folder, [0.0, 1.0])
    monkeypatch.setattr(Path, "write_bytes", raising(OSError(errno.ENOSPC, "full")))
    with pytest.raises(OutputError, match="the disk is full"):
        write_ply_sequence(oracles_io.scene(), folder, [0.0, 1.0])
    assert_untouched(folder / "frame_0000.ply")
    assert list(tmp_path.iterdir()) == [folder]


FULL_DISK = """
import resource, sys
from pathlib import Path
import torch
import test_failed_writes as tests
from diff4splat.errors import OutputError

folder = Path(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))
for name in [*tests.WRITERS, "frames"]:
    write = tests.WRITERS.get(name, lambda f: tests.write_ply_sequence(
        tests.oracles_io.scene(), f, [0.0]))
    try:
        write(folder / name)
    except OutputError as error:
        print(name, str(error).replace(str(folder), "DIR"), sep="|")
    else:
        print(name, "NO ERROR", sep="|")
"""


@pytest.mark.slow
def test_a_disk_that_is_really_full(tmp_path: Path) -> None:
    """No file may grow beyond 300 bytes, which is what a full disk looks like to a writer."""
    paths = os.pathsep.join([str(Path(__file__).parent), str(Path(oracles_io.__file__).parent)])
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    messages = dict(line.split("|") for line in done.stdout.splitlines())
    assert set(messages) == {*WRITERS, "frames"}
    for name, message in messages.items():
        assert message.startswith(f"DIR/{name}: expected"), name
        assert "would be larger" in message or "the disk may be full" in message
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_that_the_exr_library_reports_in_its_own_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(self: object, name: str) -> None:
        Path(name).write_bytes(b"half")
        raise RuntimeError(f'Failed to write to "{name}". No space left on device.')

    monkeypatch.setattr(exr.OpenEXR.File, "write", write)
    with pytest.raises(OutputError, match="the disk is full"):
        WRITERS["depth.exr"](tmp_path / "a.exr")
    assert list(tmp_path.iterdir()) == []
