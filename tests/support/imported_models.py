"""Fixtures: tiny Wan folders as diffusers saves them, and our models of them, made once."""

from pathlib import Path

import pytest
import wan_folder

from diff4splat.models.public_weights.import_model import (
    ImportOptions,
    open_public_model,
    write_model,
)

KINDS = ("t2v", "i2v", "ti2v", "a14b")


def settings(kind: str) -> ImportOptions:
    """Few frames, two tokens a side."""
    side = 64 if kind == "ti2v" else 32
    return ImportOptions(reconstruction="test", frames=5, size_px=(side, side))


@pytest.fixture(scope="session")
def wan_source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A text-to-video folder in shards of 20 kB; copy it before you change it."""
    return wan_folder.write_wan(tmp_path_factory.mktemp("wan") / "source", max_shard_size="20KB")


@pytest.fixture(scope="session")
def imported(wan_source: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Our model folder of every kind."""
    folders = {}
    for kind in KINDS:
        folder = tmp_path_factory.mktemp(kind)
        source = wan_source if kind == "t2v" else wan_folder.write_wan(folder / "source", kind)
        folders[kind] = folder / "model"
        write_model(open_public_model(source, settings(kind)), folders[kind])
    return folders
