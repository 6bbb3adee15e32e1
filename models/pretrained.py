"""A model as it is loaded and saved: configuration, networks, and whether anybody trained it.

config.json  provenance.json  {vae,text_encoder,dit,ldrm,deformation}.safetensors
"""

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff4splat.errors import CheckpointError, ConfigError
from diff4splat.io.atomic import write_text
from diff4splat.models.config import ModelConfig
from diff4splat.models.factory import (
    Networks,
    create_networks,
    create_text_encoder,
    parameter_counts,
)
from diff4splat.models.sizes import SIZES, size_by_name
from diff4splat.models.weights import (
    load_config,
    load_networks,
    load_text_encoder,
    save_networks,
    weights_sha256,
)

PROVENANCE_FILE = "provenance.json"
BYTES_PER_WEIGHT = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Everything a pipeline needs. The text encoder is absent until a prompt asks for it."""

    config: ModelConfig
    networks: Networks
    folder: Path | None = None
    """Where the weights lie; None for random ones."""
    weights_sha256: str = "none"
    untrained: bool = True

    @property
    def device(self) -> torch.device:
        """Where the networks are."""
        return next(self.networks.dit.parameters()).device


def load_model(name_or_folder: str | Path) -> Model:
    """A model folder, or a size with random weights; without the text encoder.

    Raises:
        ConfigError: neither a folder nor a size, or more than this machine's memory.
        CheckpointError: weights and configuration do not belong together.
    """
    folder = Path(name_or_folder)
    if not _is_folder(folder):
        config = size_by_name(str(name_or_folder))
        _require_memory(config)
        return Model(config=config, networks=create_networks(config, with_text=False))
    config, networks = load_networks(folder, with_text=False)
    return Model(
        config=config,
        networks=networks,
        folder=folder,
        weights_sha256=weights_sha256(folder),
        untrained=_is_untrained(folder),
    )


def find_config(name_or_folder: str | Path) -> ModelConfig:
    """The configuration alone, without any weights.

    Raises:
        ConfigError, CheckpointError: as ``load_model``.
    """
    folder = Path(name_or_folder)
    return load_config(folder) if _is_folder(folder) else size_by_name(str(name_or_folder))


def with_text_encoder(model: Model) -> Model:
    """The same model with its text encoder; the other networks are shared."""
    if model.networks.text_encoder is not None:
        return model
    if model.folder is None:
        encoder = create_text_encoder(model.config)
    else:
        encoder = load_text_encoder(model.folder, model.config)
    return replace(model, networks=replace(model.networks, text_encoder=encoder.to(model.device)))


def save_model(model: Model, folder: Path) -> None:
    """Write a folder that ``load_model`` reads, text encoder included."""
    complete = with_text_encoder(model)
    provenance = {"format": "diff4splat-model", "version": 1, "untrained": model.untrained}
    write_text(folder / PROVENANCE_FILE, json.dumps(provenance, indent=2) + "\n")
    save_networks(complete.networks, model.config, folder)


def _is_folder(folder: Path) -> bool:
    try:
        return folder.is_dir()
    except OSError:
        return False  # longer than any name


def _is_untrained(folder: Path) -> bool:
    """What the provenance file says; a model without one counts as untrained."""
    file = folder / PROVENANCE_FILE
    if not file.is_file():
        return True
    try:
        return bool(json.loads(file.read_text(encoding="utf-8"))["untrained"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise CheckpointError(
            f"{file}: expected a JSON object with 'untrained', got something else; "
            "fetch the model again"
        ) from error


def _require_memory(config: ModelConfig) -> None:
    needed = sum(parameter_counts(config).values()) * BYTES_PER_WEIGHT
    present = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > 0.8 * present:
        raise ConfigError(
            f"model {config.name!r}: expected at least {needed / 0.8 / 2**30:.0f} GiB of memory "
            f"for its weights, got {present / 2**30:.0f} GiB; choose another of {', '.join(SIZES)}"
        )
