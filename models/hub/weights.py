"""Networks on disk: one ``.safetensors`` per part beside ``config.json``; never pickle.

    config.json  {vae,text_encoder,dit,ldrm,deformation}.safetensors

Reading is strict: every key and every shape must be the one the configuration asks for. Weights
may be stored in half precision; they are read into float32. Whether a part may be absent is for
provenance.py to say.
"""

import hashlib
from collections.abc import Collection
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.atomic import atomic_path, write_text
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import PARTS, Networks, create_networks, create_text_encoder
from diff4splat.models.text_encoder.encoder import TextEncoder

CONFIG_FILE = "config.json"
SHOWN = 3
"""Names listed in an error message before "and so on"."""


def save_networks(
    networks: Networks,
    config: ModelConfig,
    folder: Path,
    dtype: torch.dtype = torch.float32,
    only: Collection[str] = PARTS,
) -> None:
    """Write the parts in ``dtype``, and the configuration last: a folder with one is complete.

    Raises:
        CheckpointError: a weight is NaN or infinite, in ``dtype``.
        OutputError: the folder cannot be written.
    """
    for name, part in networks.parts():
        if name not in only:
            continue
        tensors = {
            key: value.detach().cpu().to(dtype).contiguous()
            for key, value in part.state_dict().items()
        }
        _require_finite(tensors, name)
        with atomic_path(part_file(folder, name)) as temporary:
            _save_readable(tensors, temporary)
    write_text(folder / CONFIG_FILE, config.to_json())


def load_networks(
    folder: Path, with_text: bool = True, may_lack: Collection[str] = ()
) -> tuple[ModelConfig, Networks]:
    """The configuration and its networks, on the CPU in float32.

    Parts in ``may_lack`` that have no file get the random weights of ``create_networks``.

    Raises:
        CheckpointError: a file is absent, or keys or shapes do not belong to the configuration.
        FileFormatError: a file is damaged.
        ConfigError: the configuration is not valid.
    """
    config = load_config(folder)
    drawn = {name for name in may_lack if not part_file(folder, name).is_file()}
    networks = create_networks(config, with_text=with_text, needed=drawn)
    for name, part in networks.parts():
        if name not in drawn:
            _fill(part, _read(part_file(folder, name)), name)
    return config, networks


def load_text_encoder(folder: Path, config: ModelConfig) -> TextEncoder:
    """The text encoder of a model folder, alone.

    Raises:
        CheckpointError, FileFormatError: as ``load_networks``.
    """
    encoder = create_text_encoder(config, "meta")
    _fill(encoder, _read(part_file(folder, "text_encoder")), "text_encoder")
    return encoder


def load_config(folder: Path) -> ModelConfig:
    """The configuration alone."""
    path = folder / CONFIG_FILE
    if not path.is_file():
        raise CheckpointError(
            f"{folder}: expected a model folder with {CONFIG_FILE}, got none; check the path"
        )
    try:
        return ModelConfig.from_json(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise FileFormatError(
            f"{path}: expected JSON in UTF-8, got other bytes; fetch the model again"
        ) from error


def weights_sha256(folder: Path) -> str:
    """SHA-256 over the weight files that exist, names included, in a fixed order."""
    digest = hashlib.sha256()
    for name in PARTS:
        path = part_file(folder, name)
        if path.is_file():
            with path.open("rb") as file:
                digest.update(
                    f"{name}:{hashlib.file_digest(file, 'sha256').hexdigest()}\n".encode()
                )
    return digest.hexdigest()


def part_file(folder: Path, name: str) -> Path:
    """Where a part's weights lie."""
    return folder / f"{name}.safetensors"


def _read(path: Path) -> dict[str, Tensor]:
    if not path.is_file():
        raise CheckpointError(f"{path}: expected a weight file, got none; fetch the model again")
    try:
        return load_file(path)
    except SafetensorError as error:
        raise FileFormatError(
            f"{path}: expected safetensors, got a damaged file; fetch the model again"
        ) from error


def _fill(part: nn.Module, tensors: dict[str, Tensor], name: str) -> None:
    wanted = {key: tuple(value.shape) for key, value in part.state_dict().items()}
    got = {key: tuple(value.shape) for key, value in tensors.items()}
    _refuse([key for key in wanted if key not in got], f"{name} weights: missing")
    _refuse([key for key in got if key not in wanted], f"{name} weights: unexpected")
    wrong = [
        f"{key} {got[key]} instead of {wanted[key]}" for key in wanted if got[key] != wanted[key]
    ]
    _refuse(wrong, f"{name} weights: wrong shape of")
    _require_finite(tensors, name)
    part.load_state_dict({key: value.float() for key, value in tensors.items()}, assign=True)


def _refuse(found: list[str], what: str) -> None:
    if found:
        listed = ", ".join(found[:SHOWN]) + (", …" if len(found) > SHOWN else "")
        raise CheckpointError(
            f"{what} {len(found)} ({listed}); the weights belong to another configuration"
        )


def _save_readable(tensors: dict[str, Tensor], file: Path) -> None:
    """As readable as any other file; safetensors would make it the owner's alone."""
    file.touch()
    mode = file.stat().st_mode
    save_file(tensors, file)
    file.chmod(mode)


def _require_finite(tensors: dict[str, Tensor], name: str) -> None:
    for key, value in tensors.items():
        if not bool(torch.isfinite(value).all()):
            raise CheckpointError(
                f"{name} weights: expected finite numbers in {key}, got NaN or infinity"
            )
