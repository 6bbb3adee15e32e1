"""CheckpointStore on disk: how folders are named, described, found and checked.

    checkpoints/latest                       the name of the newest one; replaced last
    checkpoints/window-000-step-00000500/    state.json and shard-*.safetensors

A checkpoint counts once ``latest`` names it. ``state.json`` holds the SHA-256 of every other file,
so that truncated or damaged files are recognised; its version 1 holds a recipe of the first
release. Chronological order is (window, step): the
window number grows with every roll-back. Nothing here is pickle.
"""

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff4splat.errors import FileFormatError
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.require_file import is_file, read_text, require_file
from diff4splat.paths.formats.json_text import decode_object
from diff4splat.training.recipe.legacy import upgraded_stage
from diff4splat.training.trainer.distributed.processes import Processes
from diff4splat.training.trainer.loop.progress import Progress

STATE_FILE, LATEST_FILE = "state.json", "latest"
FORMAT, VERSION = "diff4splat-training", 2
_NAME = re.compile(r"window-([0-9]{3,9})-step-([0-9]{8,18})")


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """A checkpoint that was found whole."""

    folder: Path
    stage: str
    fingerprint: str
    recipe: Mapping[str, Any]
    """The stage's recipe as plain values, to say what differs."""
    progress: Progress

    @property
    def finished(self) -> bool:
        """Whether the stage was over."""
        return self.progress.step >= self.recipe["steps"]


def checkpoint_name(progress: Progress) -> str:
    """Folder name of a checkpoint."""
    return f"window-{progress.rollbacks:03d}-step-{progress.step:08d}"


def order(name: str) -> tuple[int, int]:
    """Sorts names by when they were written."""
    window, step = _NAME.fullmatch(name).groups()
    return int(window), int(step)


def candidates(folder: Path) -> list[str]:
    """Names to try: what ``latest`` says, then the others from new to old."""
    if not folder.is_dir():
        return []
    present = [path.name for path in folder.iterdir() if _NAME.fullmatch(path.name)]
    present.sort(key=order, reverse=True)
    latest = _pointer(folder / LATEST_FILE)
    return [name for name in present if name == latest] + [n for n in present if n != latest]


def _pointer(file: Path) -> str:
    """What ``latest`` says; a damaged one says nothing, and the newest checkpoint is tried."""
    try:
        return read_text(file, "the name of a checkpoint").strip() if is_file(file) else ""
    except FileFormatError:
        return ""


def digests(folder: Path, processes: Processes) -> dict[str, str]:
    """SHA-256 of every tensor file; processes share the reading."""

    def mine() -> dict[str, str]:
        names = sorted(path.name for path in folder.glob("*.safetensors"))
        return {name: _sha256(folder / name) for name in names[processes.rank :: processes.count]}

    return dict(pair for found in processes.all_do(mine) for pair in sorted(found.items()))


def write_state(folder: Path, description: Mapping[str, Any]) -> None:
    """Write ``state.json`` through to the disk: it says that the rest is there."""
    with (folder / STATE_FILE).open("w", encoding="utf-8") as file:
        json.dump({"format": FORMAT, "version": VERSION} | dict(description), file, indent=2)
        file.flush()
        os.fsync(file.fileno())


def read_checkpoint(folder: Path, processes: Processes) -> Checkpoint:
    """A whole checkpoint, every byte compared with its digest.

    Raises:
        FileFormatError: it is half written, damaged or from a newer version; at all processes.
    """
    description = processes.first_does(lambda: _read_state(folder))
    if digests(folder, processes) != description["files"]:
        raise FileFormatError(f"{folder}: expected the files that were written, got other bytes")
    try:
        progress = Progress.from_json(description["progress"])
    except FileFormatError as error:
        raise FileFormatError(f"{folder / STATE_FILE}, {error}") from error
    recipe = description["recipe"]
    if type(recipe.get("steps")) is not int:
        raise FileFormatError(f"{folder / STATE_FILE}: expected a recipe with steps, got none")
    return Checkpoint(
        folder=folder,
        stage=description["stage"],
        fingerprint=description["fingerprint"],
        recipe=upgraded_stage(recipe) if description["version"] == 1 else recipe,
        progress=progress,
    )


def _read_state(folder: Path) -> dict[str, Any]:
    file = folder / STATE_FILE
    try:
        found = decode_object(read_text(file, "the state of a training run"))
        version = found.get("version")
        usable = found.get("format") == FORMAT and type(version) is int
        wanted = {"stage": str, "fingerprint": str, "recipe": dict, "progress": dict, "files": dict}
        wrong = [key for key, kind in wanted.items() if not isinstance(found.get(key), kind)]
    except FileFormatError as error:
        raise FileFormatError(
            f"{file}: expected the state of a training run, got none or a damaged one ({error})"
        ) from error
    if not usable or wrong or not 1 <= version <= VERSION:
        raise FileFormatError(
            f"{file}: expected {FORMAT} up to version {VERSION}, got "
            f"{str(found.get('format'))[:60]} {str(version)[:20]} without {', '.join(wrong) or '-'}"
        )
    return found


def _sha256(file: Path) -> str:
    require_file(file, "tensors of a checkpoint")
    return file_sha256(file)
