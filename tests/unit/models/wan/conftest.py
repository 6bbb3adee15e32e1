"""Tiny Wan folders, saved and imported once."""

from pathlib import Path

import pytest
import wan_folder

from diff4splat.models.hub.model import Model, load_model
from diff4splat.models.public_weights.import_model import (
    ImportSettings,
    open_public_model,
    write_model,
)

KINDS = ("t2v", "i2v", "ti2v")


@pytest.fixture(scope="session")
def imported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Our model folder of every kind; shards of 20 kB."""
    folders = {}
    for kind in KINDS:
        source = tmp_path_factory.mktemp(kind) / "source"
        wan_folder.write_wan(source, kind, max_shard_size="20KB")
        side = 64 if kind == "ti2v" else 32
        settings = ImportSettings(reconstruction="test", frames=5, size_px=(side, side))
        folders[kind] = source.parent / "model"
        write_model(open_public_model(source, settings), folders[kind])
    return folders


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def model(imported: dict[str, Path], kind: str) -> Model:
    return load_model(imported[kind], parts=("vae", "text_encoder", "dit"))
