"""Locks on folders: one process writes there, also when two containers share the folder.

A lock is an ``flock`` on the open folder. It leaves no file behind and ends with its process,
however that ends. Process numbers could not say this: in containers every process is number 1.
File systems without ``flock`` on folders (some network ones, Windows) are written without a lock.
"""

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from diff4splat.errors import OutputError
from diff4splat.io.output_error import output_error
from diff4splat.progress.interrupts import uninterrupted

try:
    import fcntl
except ImportError:  # Windows has no locks on folders
    fcntl = None

_HELD: Counter[tuple[int, int]] = Counter()
"""(device, inode) of folders that this process has locked, and how often."""


@contextmanager
def sole_writer(folder: Path, name: Path | None = None, wait: bool = False) -> Iterator[None]:
    """Make ``folder`` and keep other processes from writing there; nested calls share the lock.

    With ``wait`` another process's lock is waited for. A folder that was made here and stays empty
    is removed. Messages say ``name``, or the folder.

    Raises:
        OutputError: another process writes there, or the folder cannot be made.
    """
    made = not folder.exists()
    try:
        descriptor = _make_and_lock(folder, wait)
    except BlockingIOError as error:
        raise OutputError(
            f"{name or folder}: expected to be the only writer, but another process is writing "
            "there; wait until it ends, or choose another name"
        ) from error
    except OSError as error:
        raise output_error(name or folder, error) from error
    key = _identity(folder)
    _HELD[key] += 1
    try:
        yield
    finally:
        with uninterrupted():
            _HELD[key] -= 1
            if made:
                with suppress(OSError):
                    folder.rmdir()
            if descriptor is not None:
                os.close(descriptor)


def lock_folder(folder: Path, wait: bool = False) -> int:
    """An open descriptor that holds the lock.

    Raises:
        BlockingIOError: another process holds it.
        FileNotFoundError: there is no such folder, or it was removed meanwhile.
        OSError: the folder cannot be opened, or its file system has no locks.
    """
    if fcntl is None:
        raise OSError("no locks on folders")
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        if _identity(folder) != _identity(descriptor):
            raise FileNotFoundError(folder)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _make_and_lock(folder: Path, wait: bool) -> int | None:
    """None where this process has the lock already, or there are no locks."""
    while True:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            return None if _identity(folder) in +_HELD else lock_folder(folder, wait)
        except FileNotFoundError:
            continue  # its maker left it empty and removed it just now
        except BlockingIOError:
            raise
        except OSError:
            return None


def _identity(folder: Path | int) -> tuple[int, int]:
    status = os.stat(folder)
    return status.st_dev, status.st_ino
