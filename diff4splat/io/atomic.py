"""Outputs appear whole or not at all: write under a temporary name, then rename."""

import errno
import hashlib
import os
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from diff4splat.errors import OutputError
from diff4splat.io.locks import sole_writer
from diff4splat.io.output_error import output_error
from diff4splat.io.partials import PREFIX, Partial, remove_abandoned
from diff4splat.progress.interrupts import raise_if_stopped, uninterrupted


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Yield a temporary name near ``target`` and rename it when the block succeeds.

    The file name is kept, because some writers choose the format by its suffix. On any failure, an
    interrupt included, the temporary file is removed and an existing ``target`` stays as it was.

    Raises:
        OutputError: the folder cannot be made or written, or another process writes this file.
    """
    with ExitStack() as stack, _in_words(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_dir():
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
        remove_abandoned(target.parent)
        stack.enter_context(sole_writer(_claim(target), target))
        temporary = _own_folder(target.parent, stack) / target.name
        yield temporary
        raise_if_stopped()
        with uninterrupted():
            os.replace(temporary, target)


def _claim(target: Path) -> Path:
    """The folder whose lock says that ``target`` is being written."""
    digest = hashlib.sha256(os.fsencode(target.name)).hexdigest()
    return target.parent / f"{PREFIX}{digest[:16]}"


def _own_folder(beside: Path, stack: ExitStack) -> Path:
    partial = Partial(beside)
    stack.callback(_discard, partial)
    return partial.folder


def _discard(partial: Partial) -> None:
    with uninterrupted():
        partial.discard()


@contextmanager
def _in_words(target: Path) -> Iterator[None]:
    """Errors of the system as ours."""
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise output_error(target, error) from error


def write_text(target: Path, text: str) -> None:
    """Write a small text file whole or not at all."""
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def copy_file(source: Path, target: Path) -> None:
    """The same file under another name, without a second copy of its bytes where that is possible.

    Raises:
        OutputError: the folder cannot be made or written.
    """
    if target.exists() and target.samefile(source):
        return
    with atomic_path(target) as temporary:
        try:
            os.link(source.resolve(), temporary)
        except OSError:
            # Another disk, or one without links.
            shutil.copyfile(source, temporary)


@contextmanager
def atomic_folder(target: Path, owned: Collection[str] = ()) -> Iterator[Path]:
    """Yield an empty staging folder and move its files into ``target`` when the block succeeds.

    Files named in ``owned`` that were not made again are removed then: an older run's depth beside
    a newer run's scene would be taken for its own.

    A set of files that belong together appears together: on any failure, an interrupt included,
    everything staged is removed and what stood in ``target`` before is untouched. Entering the
    block already proves that the folder can be written.

    Raises:
        OutputError: the folder cannot be made or written, or another process writes there.
    """
    with ExitStack() as stack, _in_words(target):
        stack.enter_context(sole_writer(target))
        remove_abandoned(target)
        staging = _own_folder(target, stack)
        try:
            yield staging
        except OutputError as error:
            # People know the folder they named, not the one it was staged in.
            raise OutputError(str(error).replace(str(staging), str(target))) from error
        raise_if_stopped()
        with uninterrupted():
            _move(staging, target, owned)


def _move(staging: Path, target: Path, owned: Collection[str]) -> None:
    staged = {file.name: file for file in sorted(staging.iterdir())}
    _require_no_folder(target / name for name in {*staged, *owned})
    for name, file in staged.items():
        os.replace(file, target / name)
    for name in set(owned) - set(staged):
        (target / name).unlink(missing_ok=True)


def _require_no_folder(files: Iterable[Path]) -> None:
    """Found before the first file is replaced, so that a set is never half new."""
    for file in files:
        if file.is_dir():
            raise output_error(file, OSError(errno.EISDIR, os.strerror(errno.EISDIR)))
