"""The cache of public weights: one folder per model, with the hashes of its files.

    $DIFF4SPLAT_CACHE or $XDG_CACHE_HOME/diff4splat or ~/.cache/diff4splat
      models/NAME/{model.onnx, SHA256SUMS}

``DIFF4SPLAT_MIRROR`` replaces the addresses: a folder or a web address with NAME/FILE below it.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.io.require_file import is_file, read_text
from diff4splat.models.registry.catalog import ModelFile, PublicModel

CACHE_VARIABLE, MIRROR_VARIABLE = "DIFF4SPLAT_CACHE", "DIFF4SPLAT_MIRROR"
SUMS_FILE = "SHA256SUMS"


def model_folder(model: PublicModel) -> Path:
    """Where the files of a model are, or would be."""
    given = os.environ.get(CACHE_VARIABLE)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    root = Path(given) if given else Path(base) / "diff4splat"
    return root / "models" / model.name


def address_of(model: PublicModel, file: ModelFile) -> str:
    """Where to get a file: its publisher, or the mirror that the environment names."""
    mirror = os.environ.get(MIRROR_VARIABLE)
    return f"{mirror.rstrip('/')}/{model.name}/{file.name}" if mirror else file.address


def cached_graph(model: PublicModel) -> Path:
    """The graph of a model that was downloaded.

    Raises:
        ConfigError: it was not.
    """
    folder = model_folder(model)
    missing = [file.name for file in model.files if not is_file(folder / file.name)]
    if missing:
        raise ConfigError(
            f"{model.name}: expected its files in {folder}, got none; "
            f"run diff4splat models get {model.name}"
        )
    return folder / model.files[0].name


def recorded_hashes(folder: Path) -> dict[str, str]:
    """Hashes that earlier downloads wrote, by file name.

    Raises:
        FileFormatError: the list is damaged.
    """
    sums = folder / SUMS_FILE
    if not is_file(sums):
        return {}
    found = {}
    for line in read_text(sums, "a list of hashes").splitlines():
        match = re.fullmatch(r"([0-9a-f]{64})  ([\w.-]+)", line)
        if match is None:
            raise FileFormatError(
                f"{sums}: expected lines of a hash and a name, got {line[:80]!r}; remove the file"
            )
        found[match[2]] = match[1]
    return found


def record_hashes(folder: Path, hashes: Mapping[str, str]) -> None:
    """Write the list whole or not at all; ``sha256sum -c`` reads it too."""
    lines = (f"{digest}  {name}\n" for name, digest in sorted(hashes.items()))
    write_text(folder / SUMS_FILE, "".join(lines))
