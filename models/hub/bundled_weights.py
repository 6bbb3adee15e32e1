"""Weights that are installed with the package: one folder per size, named like it.

    models/weights/<size>/{config.json, provenance.json, <part>.safetensors, SHA256SUMS, CARD.md}

A size without a folder has random weights. The folder holds data only; it is no package.
"""

from pathlib import Path

from diff4splat.models.config.sizes import SIZES

WEIGHTS_FOLDER = Path(__file__).parents[1] / "weights"
CARD_FILE = "CARD.md"
"""Model card for people; no code reads it."""


def bundled_folder(size: str) -> Path | None:
    """Folder of a size's weights; None if none are bundled, or if there is no such size."""
    folder = WEIGHTS_FOLDER / size if size in SIZES else None
    return folder if folder is not None and folder.is_dir() else None
