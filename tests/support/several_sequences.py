"""A copy of a data set with several sequences: the smallest format, one sequence many times."""

import shutil
from pathlib import Path

from dataset_writers import realestate10k
from toy_datasets import TOYS


def write_sequences(root: Path, count: int, damaged: tuple[int, ...] = ()) -> Path:
    """``count`` sequences, of which some have a cut off image."""
    realestate10k.write(TOYS["realestate10k"].truth(), root)
    folder = root / "train"
    for number in range(1, count):
        name = f"{number:016x}"
        shutil.copytree(folder / realestate10k.NAME, folder / name)
        shutil.copy(folder / f"{realestate10k.NAME}.txt", folder / f"{name}.txt")
        if number in damaged:
            image = min((folder / name).glob("*.png"))
            image.write_bytes(image.read_bytes()[:100])
    return root


PIPELINE = """
version = 1
out = "work"
tasks = {tasks}
[import]
path = "copy"
dataset = "realestate10k"
{more}
"""


def write_settings(folder: Path, tasks: int, more: str = "") -> Path:
    """Settings of a pipeline over the copy in ``folder / "copy"``."""
    file = folder / "pipeline.toml"
    file.write_text(PIPELINE.format(tasks=tasks, more=more))
    return file
