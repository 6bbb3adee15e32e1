"""What every folder of shipped weights promises; nothing to do where none ships yet."""

from pathlib import Path

import pytest

from diff4splat.models.config.sizes import SIZES, size_by_name
from diff4splat.models.factory import PARTS
from diff4splat.models.hub.bundled_weights import CARD_FILE, WEIGHTS_FOLDER
from diff4splat.models.hub.pretrained import load_model
from diff4splat.models.hub.provenance import NOT_STATED

ROOT = Path(__file__).parents[2]
FILES = {"config.json", "provenance.json", "SHA256SUMS", CARD_FILE}
MOST_BYTES = 60e6
"""Package indexes take 100 MB."""
FOLDERS = sorted(WEIGHTS_FOLDER.iterdir()) if WEIGHTS_FOLDER.is_dir() else []


def test_weights_lie_beside_the_modules_and_are_no_package() -> None:
    assert WEIGHTS_FOLDER.resolve() == ROOT / "models" / "weights"
    assert not list(WEIGHTS_FOLDER.rglob("*.py"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_shipped_weights_are_whole_and_stated(folder: Path) -> None:
    assert folder.name in SIZES
    model = load_model(folder.name)
    assert model.config == size_by_name(folder.name)
    assert model.trained
    assert NOT_STATED not in (model.license, model.origin)
    parts = {f"{part}.safetensors" for part in PARTS if part in model.trained}
    assert {file.name for file in folder.iterdir()} == FILES | parts
    assert sum(file.stat().st_size for file in folder.iterdir()) < MOST_BYTES
