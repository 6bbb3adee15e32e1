"""Makes the items of the gallery, one after the other; what is finished is kept."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from examples.gallery.items import DIFF4SPLAT, WORLD_PICTURE, Item

ROOT = Path(__file__).parents[2]
RECORD = "item.json"
PROGRAMS = {
    DIFF4SPLAT: ("-m", "diff4splat.cli.main"),
    WORLD_PICTURE: (str(ROOT / "examples" / "make_world_picture.py"),),
}


class ItemError(Exception):
    """A step of an item failed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """What an item cost, as its folder records it."""

    steps: list[list[str]]
    seconds: float
    peak_memory_bytes: int
    scene_bytes: int
    video: str
    """Name of the video in the folder."""


def make(item: Item, gallery: Path) -> Made:
    """The item in its folder; made again only if its steps are others than last time.

    Raises:
        ItemError: a step failed; its folder holds ``log.txt``.
    """
    folder = gallery / item.name
    if (found := finished(item, folder)) is not None:
        return found
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    start_s = time.monotonic()
    peaks = [_run(_filled(step, gallery, folder), folder) for step in item.steps]
    (video,) = sorted(file.name for file in folder.glob("video.*"))
    scene = (gallery / (item.scene or item.name)) / "scene.safetensors"
    made = Made(
        steps=[list(step) for step in item.steps],
        seconds=round(time.monotonic() - start_s, 1),
        peak_memory_bytes=max(peaks),
        scene_bytes=scene.stat().st_size,
        video=video,
    )
    partial = folder / f".{RECORD}"
    partial.write_text(json.dumps(asdict(made), indent=1))
    partial.replace(folder / RECORD)
    return made


def finished(item: Item, folder: Path) -> Made | None:
    """The record of an item that was made with the same steps."""
    try:
        made = Made(**json.loads((folder / RECORD).read_text()))
    except (OSError, ValueError, TypeError):
        return None
    return made if made.steps == [list(step) for step in item.steps] else None


def make_all(items: Sequence[Item], gallery: Path, tell: Callable[[str], None]) -> dict[str, Made]:
    """Every item that can be made, by name; those that fail are reported and left out."""
    done: dict[str, Made] = {}
    start_s, fresh = time.monotonic(), 0
    for place, item in enumerate(items):
        known = finished(item, gallery / item.name) is not None
        left = ""
        if fresh:
            left_s = (time.monotonic() - start_s) / fresh * (len(items) - place)
            left = f", about {left_s / 60:.0f} min left"
        tell(f"{place + 1}/{len(items)} {item.name}{' (kept)' if known else left}")
        try:
            done[item.name] = make(item, gallery)
        except ItemError as error:
            tell(f"  left out: {error}")
        fresh += not known
    return done


def _filled(step: Sequence[str], gallery: Path, folder: Path) -> list[str]:
    places = {"{gallery}": str(gallery), "{out}": str(folder)}
    filled = list(step)
    for mark, path in places.items():
        filled = [argument.replace(mark, path) for argument in filled]
    return filled


def _run(step: Sequence[str], folder: Path) -> int:
    """Run one step; returns its largest memory in bytes."""
    if step[0] == "photo":
        return _copy_photo(step[1], Path(step[2]))
    command = [sys.executable, *PROGRAMS[step[0]], *step[1:]]
    with (folder / "log.txt").open("a") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, cwd=ROOT)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise ItemError(f"{step[0]} {step[1]} failed; see {folder / 'log.txt'}")
    return usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def _copy_photo(name: str, file: Path) -> int:
    """A photograph that comes with scikit-image."""
    from PIL import Image
    from skimage import data

    Image.fromarray(getattr(data, name)()).save(file)
    return 0
