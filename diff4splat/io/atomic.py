"""Outputs appear whole or not at all: write under a temporary name, then rename."""

import errno
import os
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from diff4splat.errors import OutputError

_NUMBERS = count()
"""Tells apart writers of one process that aim at one target."""
_ADVICE = {
    errno.ENOSPC: "the disk is full; free some space or choose another folder",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another folder",
    errno.EFBIG: "the file would be larger than this system allows; choose another folder",
    errno.EACCES: "no permission to write there; choose another folder",
    errno.EPERM: "no permission to write there; choose another folder",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.ENOTDIR: "a file stands where a folder is needed; choose another folder",
    errno.EEXIST: "a file stands where a folder is needed; choose another folder",
    errno.EISDIR: "a folder stands where the file should go; remove it or choose another name",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
}


def output_error(target: Path, error: OSError) -> OutputError:
    """The same failure in words that say what to do."""
    advice = _ADVICE.get(error.errno or 0, error.strerror or str(error))
    return OutputError(f"{target}: expected to write here, but {advice}")


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Yield a temporary name beside ``target`` and rename it when the block succeeds.

    The suffix is kept, because some writers choose the format by it. On any failure, an interrupt
    included, the temporary file is removed and an existing ``target`` stays as it was.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    temporary = target.parent / f".partial-{os.getpid()}-{next(_NUMBERS)}{target.suffix}"
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
        yield temporary
        os.replace(temporary, target)
    except OutputError:
        raise
    except OSError as error:
        raise output_error(target, error) from error
    finally:
        # A failing clean-up must not hide why the write failed.
        with suppress(OSError):
            temporary.unlink()


def write_text(target: Path, text: str) -> None:
    """Write a small text file whole or not at all."""
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextmanager
def atomic_folder(target: Path, owned: Collection[str] = ()) -> Iterator[Path]:
    """Yield an empty staging folder and move its files into ``target`` when the block succeeds.

    Files named in ``owned`` that were not made again are removed then: an older run's depth beside
    a newer run's scene would be taken for its own.

    A set of files that belong together appears together: on any failure, an interrupt included,
    everything staged is removed and what stood in ``target`` before is untouched. Entering the
    block already proves that the folder can be written.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    existed, staging = True, target / f".partial-{os.getpid()}-{next(_NUMBERS)}"
    try:
        existed = target.exists()
        staging.mkdir(parents=True, exist_ok=True)
        yield staging
        staged = {file.name: file for file in sorted(staging.iterdir())}
        _require_no_folder(target / name for name in {*staged, *owned})
        for name, file in staged.items():
            os.replace(file, target / name)
        for name in set(owned) - set(staged):
            (target / name).unlink(missing_ok=True)
    except OutputError as error:
        # People know the folder they named, not the one it was staged in.
        raise OutputError(str(error).replace(str(staging), str(target))) from error
    except OSError as error:
        raise output_error(target, error) from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if not existed and target.is_dir() and not any(target.iterdir()):
            target.rmdir()


def _require_no_folder(files: Iterable[Path]) -> None:
    """Found before the first file is replaced, so that a set is never half new."""
    for file in files:
        if file.is_dir():
            raise output_error(file, OSError(errno.EISDIR, os.strerror(errno.EISDIR)))
