"""Whole or not at all: the temporary name, the rename, and what a failure says."""

import errno
from pathlib import Path

import pytest

from diff4splat.errors import OutputError
from diff4splat.io.atomic import atomic_folder, atomic_path, output_error, write_text


def test_the_file_appears_only_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "folder" / "a.txt"
    with atomic_path(target) as temporary:
        assert temporary.parent.parent == target.parent, "a rename must not cross file systems"
        assert temporary.suffix == ".txt", "writers choose the format by it"
        temporary.write_text("x")
        assert not target.exists()
    assert target.read_text() == "x"
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("ours"), OutputError("said")])
def test_other_errors_pass_through_and_leave_nothing(tmp_path: Path, error: BaseException) -> None:
    write_text(tmp_path / "a.txt", "precious")
    with pytest.raises(type(error)) as caught, atomic_path(tmp_path / "a.txt") as temporary:
        temporary.write_text("half")
        raise error
    assert caught.value is error
    assert (tmp_path / "a.txt").read_text() == "precious"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (errno.ENOSPC, "the disk is full; free some space"),
        (errno.EDQUOT, "the disk quota is used up"),
        (errno.EACCES, "no permission to write there"),
        (errno.EROFS, "the file system is read-only"),
        (errno.ENOTDIR, "a file stands where a folder is needed"),
    ],
)
def test_the_systems_errors_in_words(tmp_path: Path, code: int, says: str) -> None:
    with pytest.raises(OutputError) as caught, atomic_path(tmp_path / "a.txt") as temporary:
        temporary.touch()
        raise OSError(code, "system words")
    assert str(caught.value) == str(output_error(tmp_path / "a.txt", OSError(code, "")))
    assert f"{tmp_path / 'a.txt'}: expected to write here, but {says}" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_error_keeps_the_systems_words() -> None:
    assert "but Strange thing" in str(output_error(Path("a"), OSError(9999, "Strange thing")))


def test_a_block_that_writes_nothing_is_a_failure(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="expected to write here"), atomic_path(tmp_path / "a"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_long_but_legal_name_works_and_a_too_long_one_says_so(tmp_path: Path) -> None:
    write_text(tmp_path / ("n" * 250), "x")
    with pytest.raises(OutputError, match="name is too long"):
        write_text(tmp_path / ("n" * 300), "x")


@pytest.mark.parametrize("target", [Path("."), Path("/")])
def test_a_folder_is_no_target(target: Path) -> None:
    with pytest.raises(OutputError, match="a folder stands"):
        write_text(target, "x")


def test_two_writers_of_one_target_do_not_meet(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with atomic_path(target) as first, atomic_path(target) as second:
        assert first != second
        first.write_text("first")
        second.write_text("second")
    assert target.read_text() == "first"


def test_a_set_of_files_appears_together_or_not_at_all(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(ValueError, match="stop"), atomic_folder(out) as staging:
        (staging / "a.txt").write_text("half")
        raise ValueError("stop")
    assert not out.exists()
    with atomic_folder(out) as staging:
        (staging / "a.txt").write_text("new")
        assert not (out / "a.txt").exists()
    assert [file.name for file in out.iterdir()] == ["a.txt"]
    with pytest.raises(OutputError, match=r"out/a\.txt: ") as caught, atomic_folder(out) as staging:
        raise output_error(staging / "a.txt", OSError(errno.ENOSPC, "full"))
    assert "partial" not in str(caught.value)
    with pytest.raises(KeyboardInterrupt), atomic_folder(out) as staging:
        (staging / "a.txt").write_text("newer")
        raise KeyboardInterrupt
    assert (out / "a.txt").read_text() == "new"
    assert [file.name for file in out.iterdir()] == ["a.txt"]
