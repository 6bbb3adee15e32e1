"""What every folder of bundled weights promises."""

import json
from pathlib import Path

import pytest
import torch

from diff4splat.models.config.sizes import SIZES, size_by_name
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.bundled_weights import CARD_FILE, WEIGHTS_FOLDER
from diff4splat.models.hub.model import load_model
from diff4splat.models.hub.model_info import model_info
from diff4splat.models.hub.provenance import NOT_STATED
from diff4splat.models.networks import model_parts

ROOT = Path(__file__).parents[2]
FILES = {
    *("config.json", "provenance.json", "SHA256SUMS", CARD_FILE),
    "LICENSE-image-inpainting.txt",
}
MAX_BYTES = 60e6
"""Of one model; package indexes take 100 MB."""
FOLDERS = sorted(WEIGHTS_FOLDER.iterdir())
EVERY_FOLDER = pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)


def test_weights_lie_beside_the_modules_and_are_no_package() -> None:
    assert WEIGHTS_FOLDER.resolve() == ROOT / "models" / "weights"
    assert not list(WEIGHTS_FOLDER.rglob("*.py"))
    assert [folder.name for folder in FOLDERS] == ["small"]


@EVERY_FOLDER
def test_every_part_loads_and_is_trained(folder: Path) -> None:
    assert folder.name in SIZES
    model = load_model(folder.name)
    assert model.config == size_by_name(folder.name)
    assert model.loaded == model.trained == set(model.parts)
    fresh = create_networks(model.config, "meta")
    for name, part in fresh.parts():
        stored = getattr(model.networks, name).state_dict()
        assert stored.keys() == part.state_dict().keys()
        assert all(bool(torch.isfinite(value).all()) for value in stored.values()), name


@EVERY_FOLDER
def test_provenance_names_every_part_with_licence_and_origin(folder: Path) -> None:
    facts, parts = model_info(folder.name), model_parts(size_by_name(folder.name))
    assert facts.states == dict.fromkeys(parts, "trained")
    assert NOT_STATED not in (facts.provenance.license, facts.provenance.origin)
    record = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))
    assert record["version"] == 2 and record["trained"] == list(parts)


@EVERY_FOLDER
def test_the_folder_holds_these_files_and_is_small(folder: Path) -> None:
    weights = {f"{part}.safetensors" for part in model_parts(size_by_name(folder.name))}
    assert {file.name for file in folder.iterdir()} == FILES | weights
    assert sum(file.stat().st_size for file in folder.iterdir()) < MAX_BYTES
