"""Fixtures: tiny CogVideoX folders as diffusers saves them, and our models of them, made once."""

from pathlib import Path

import cogvideox_folder
import pytest

from diff4splat.models.public_weights.import_model import (
    ImportOptions,
    open_public_model,
    write_model,
)

SETTINGS = ImportOptions(reconstruction="test", frames=5, size_px=(32, 32))


@pytest.fixture(scope="session")
def cogvideox_source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A text-to-video folder in shards of 20 kB; copy it before you change it."""
    folder = tmp_path_factory.mktemp("cogvideox") / "source"
    return cogvideox_folder.write_cogvideox(folder, max_shard_size="20KB")


@pytest.fixture(scope="session")
def imported_cogvideox(
    cogvideox_source: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """Our model folder of every kind."""
    folders = {}
    for kind in cogvideox_folder.KINDS:
        folder = tmp_path_factory.mktemp("kind")
        source = (
            cogvideox_source
            if kind == "2b"
            else cogvideox_folder.write_cogvideox(folder / "source", kind)
        )
        folders[kind] = folder / "model"
        write_model(open_public_model(source, SETTINGS), folders[kind])
    return folders
