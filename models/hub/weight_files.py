"""Names, digests and configuration of a model folder, without any network.

config.json  {vae,text_encoder,dit,ldrm,deformation,monocular_depth,motion_unet}.safetensors
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.require_file import is_file, read_text
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.hub.legacy import legacy_file
from diff4splat.models.networks import PARTS
from diff4splat.paths.formats.json_text import decode_json

CONFIG_FILE = "config.json"


def load_config(folder: Path) -> ModelConfig:
    """The configuration alone."""
    return ModelConfig.from_json(_config_text(folder))


def weights_sha256(folder: Path, parts: Iterable[str] = PARTS) -> str:
    """SHA-256 over the weight files of ``parts`` that exist, in a fixed order, names included."""
    digest = hashlib.sha256()
    for path in sorted({weight_file(folder, part) for part in parts}):
        if path.is_file():
            digest.update(f"{path.stem}:{file_sha256(path)}\n".encode())
    return digest.hexdigest()


def part_file(folder: Path, name: str) -> Path:
    """Where a part's weights are written."""
    return folder / f"{name}.safetensors"


def weight_file(folder: Path, part: str) -> Path:
    """Where a part's weights are read from; version 1 kept the priors in other files."""
    return part_file(folder, legacy_file(part) if is_version_1(folder) else part)


def has_weights(folder: Path, part: str) -> bool:
    """Whether the folder holds a part's weights."""
    return weight_file(folder, part).is_file()


def is_version_1(folder: Path) -> bool:
    """Whether the folder has the layout of version 1; without a configuration it has not."""
    try:
        data = decode_json(_config_text(folder))
    except (CheckpointError, FileFormatError):
        return False
    return isinstance(data, dict) and data.get("version", 1) == 1


def _config_text(folder: Path) -> str:
    path = folder / CONFIG_FILE
    if not is_file(path):
        raise CheckpointError(
            f"{folder}: expected a model folder with {CONFIG_FILE}, got none; check the path"
        )
    return read_text(path, "the configuration of a model")
