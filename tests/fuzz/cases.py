"""What is done to the files of an example: drawn by seed, applied, undone.

A case is a list of edits; each has a seed of its own, so that leaving one out changes no other.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

from fuzz.edits.byte_edits import BYTE_EDITS
from fuzz.edits.container_edits import edits_of
from fuzz.edits.file_edits import edit_file

WHOLE_FILE = "whole file"
_WHOLE_FILE_SHARE, _STRUCTURE_SHARE = 0.03, 0.75
_EDIT_COUNTS = (1, 1, 1, 1, 2, 2, 3, 4)


@dataclass(frozen=True, slots=True)
class Edit:
    """One edit of one file."""

    file: str
    kind: str
    seed: int

    def __str__(self) -> str:
        return f"{self.file}: {self.kind} (seed {self.seed})"


class Example:
    """The files of one valid example, and where they lie."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.contents = {
            str(file.relative_to(folder)): file.read_bytes()
            for file in sorted(folder.rglob("*"))
            if file.is_file()
        }
        self._kinds: dict[str, tuple[list[str], list[str]]] = {}

    def draw(self, rng: Random) -> list[Edit]:
        """One to four edits, mostly of one file; small files are as likely as large ones."""
        names = list(self.contents)
        first = rng.choice(names)
        edits = []
        for _ in range(rng.choice(_EDIT_COUNTS)):
            name = first if rng.random() < 0.8 else rng.choice(names)
            edits.append(Edit(name, self._kind(name, rng), rng.randrange(2**32)))
        return edits

    def _kind(self, name: str, rng: Random) -> str:
        """Edits that know the format get far; those of bytes mostly end at its first check."""
        if rng.random() < _WHOLE_FILE_SHARE:
            return WHOLE_FILE
        if name not in self._kinds:
            found = edits_of(self.contents[name])
            self._kinds[name] = list(BYTE_EDITS), [kind for kind in found if kind not in BYTE_EDITS]
        plain, structured = self._kinds[name]
        return rng.choice(structured if structured and rng.random() < _STRUCTURE_SHARE else plain)

    def damage(self, edits: Sequence[Edit]) -> None:
        """Apply the edits to the files on disk."""
        contents = {edit.file: self.contents[edit.file] for edit in edits}
        for edit in edits:
            if edit.kind != WHOLE_FILE:
                contents[edit.file] = _edited(contents[edit.file], edit)
        for name, content in contents.items():
            (self.folder / name).write_bytes(content)
        for name, edit in {e.file: e for e in edits if e.kind == WHOLE_FILE}.items():
            edit_file(self.folder / name, Random(edit.seed))

    def restore(self, edits: Sequence[Edit]) -> None:
        """The files of ``edits`` as they were."""
        for name in {edit.file for edit in edits}:
            file = self.folder / name
            if file.is_dir() and not file.is_symlink():
                shutil.rmtree(file)
            elif file.is_symlink() or not file.is_file():
                file.unlink(missing_ok=True)
            self._restore_one(file, self.contents[name])

    def _restore_one(self, file: Path, content: bytes) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)


def _edited(content: bytes, edit: Edit) -> bytes:
    """The edited content; an edit that no longer fits, after others, falls back to bytes."""
    rng = Random(edit.seed)
    known = edits_of(content)
    try:
        return known[edit.kind](content, rng)
    except Exception:
        return known["flip_bits"](content, rng)
