"""Places of one's own for unfinished output: ``.partial-<16 random hex digits>`` beside a target.

Each is a folder, locked while its process lives. One whose lock can be taken belongs to nobody: a
run was killed there, and whoever writes beside it next removes it.
"""

import os
import re
import secrets
import shutil
from contextlib import suppress
from pathlib import Path

from diff4splat.io.locks import lock_folder

PREFIX = ".partial-"
_NAME = re.compile(re.escape(PREFIX) + "[0-9a-f]{16}")


class Partial:
    """An empty folder that no other process uses; ``discard`` removes it with its content."""

    def __init__(self, beside: Path) -> None:
        """Make one in the folder ``beside``, which is made too.

        Raises:
            OSError: it cannot be made.
        """
        beside.mkdir(parents=True, exist_ok=True)
        while True:
            self.folder = beside / (PREFIX + secrets.token_hex(8))
            try:
                self.folder.mkdir()
                self._descriptor = lock_folder(self.folder)
            except (FileExistsError, FileNotFoundError, BlockingIOError):
                continue  # taken, or removed by others before it was locked
            except OSError:
                if not self.folder.is_dir():
                    raise
                self._descriptor = None  # no locks here: nobody will take it for abandoned
            return

    def discard(self) -> None:
        """Leave nothing behind; a failing clean-up must not hide why a write failed."""
        shutil.rmtree(self.folder, ignore_errors=True)
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def remove_abandoned(folder: Path) -> None:
    """Remove partials of killed runs in ``folder``; nothing in a partial, which is our own."""
    if _NAME.fullmatch(folder.name):
        return
    with suppress(OSError):
        for path in [path for path in folder.iterdir() if _NAME.fullmatch(path.name)]:
            with suppress(OSError):
                descriptor = lock_folder(path)
                shutil.rmtree(path, ignore_errors=True)
                os.close(descriptor)
