"""A model as it is loaded and saved: configuration, the networks loaded so far, what is trained.

config.json  provenance.json  <part>.safetensors  [SHA256SUMS]
"""

import os
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch

from diff4splat.errors import ConfigError
from diff4splat.io.locks import sole_writer
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import SIZES, size_by_name
from diff4splat.models.factory import Networks, create_networks, model_parts, parameter_counts
from diff4splat.models.hub.checksums import SUMS_FILE
from diff4splat.models.hub.folders import checked_folder, require_parts
from diff4splat.models.hub.provenance import (
    NOT_STATED,
    PROVENANCE_FILE,
    ModelProvenance,
    read_provenance,
    write_provenance,
)
from diff4splat.models.hub.weights import (
    CONFIG_FILE,
    has_weights,
    load_config,
    load_networks,
    save_networks,
    weights_sha256,
)

BYTES_PER_WEIGHT = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model of which any number of networks are loaded."""

    config: ModelConfig
    networks: Networks = field(default_factory=Networks)
    folder: Path | None = None
    """Of the weights; None for random ones."""
    trained: frozenset[str] = frozenset()
    """Names of the parts that are trained to their end."""
    license: str = NOT_STATED
    origin: str = NOT_STATED

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of all networks that the model has, loaded or not."""
        return model_parts(self.config)

    @property
    def loaded(self) -> frozenset[str]:
        """Names of the networks that are loaded."""
        return frozenset(name for name, _ in self.networks.parts())

    def weights_sha256(self, parts: Collection[str] | None = None) -> str:
        """Digest of the weight files of ``parts``, or of all; ``none`` for random weights."""
        if self.folder is None:
            return "none"
        return weights_sha256(self.folder, self.parts if parts is None else parts)


def load_model(name_or_folder: str | Path, parts: Collection[str] | None = None) -> Model:
    """A model folder, or a size with its bundled or else random weights.

    Only ``parts`` are loaded, or all. Parts that the provenance does not call trained may have no
    file: they are random then.

    Raises:
        ConfigError: neither a folder nor a size, or more than this machine's memory.
        CheckpointError: weights and configuration do not belong together.
        FileFormatError: a file is damaged.
    """
    folder = checked_folder(name_or_folder, (CONFIG_FILE, PROVENANCE_FILE))
    if folder is None:
        model = Model(config=size_by_name(str(name_or_folder)))
    else:
        config, provenance = load_config(folder), read_provenance(folder)
        model = Model(
            config=config,
            folder=folder,
            trained=provenance.trained.intersection(model_parts(config)),
            license=provenance.license,
            origin=provenance.origin,
        )
    return with_parts(model, model.parts if parts is None else parts)


def with_parts(model: Model, parts: Collection[str]) -> Model:
    """The same model with at least ``parts`` loaded; networks that are loaded already are shared.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    missing = [part for part in model.parts if part in parts and part not in model.loaded]
    if not missing:
        return model
    fresh = _random(model, missing) if model.folder is None else _stored(model, missing)
    return replace(model, networks=replace(model.networks, **dict(fresh.parts())))


def save_model(model: Model, folder: Path) -> None:
    """Write a folder that ``load_model`` reads, all parts included, without checksums.

    Another process that writes there, such as a stage that ends at the same time, is waited for.
    """
    complete = with_parts(model, model.parts)
    provenance = ModelProvenance(trained=model.trained, license=model.license, origin=model.origin)
    with sole_writer(folder, wait=True):
        write_provenance(provenance, folder)
        # Checksums of the files before would call the new ones damaged.
        (folder / SUMS_FILE).unlink(missing_ok=True)
        save_networks(complete.networks, model.config, folder)


def _stored(model: Model, parts: Collection[str]) -> Networks:
    require_parts(model.folder, parts)
    may_lack = read_provenance(model.folder).may_lack
    drawn = [part for part in parts if part in may_lack and not has_weights(model.folder, part)]
    if drawn:
        counts = parameter_counts(model.config)
        _require_memory(model.config.name, sum(counts[part] for part in drawn))
    return load_networks(model.folder, model.config, parts, may_lack)


def _random(model: Model, parts: Collection[str]) -> Networks:
    counts = parameter_counts(model.config)
    _require_memory(model.config.name, sum(counts[part] for part in parts))
    return create_networks(model.config, parts=parts)


def _require_memory(name: str, weights: int) -> None:
    needed = weights * BYTES_PER_WEIGHT
    present = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > 0.8 * present:
        raise ConfigError(
            f"model {name!r}: expected at least {needed / 0.8 / 2**30:.0f} GiB of memory "
            f"for its weights, got {present / 2**30:.0f} GiB; choose another of {', '.join(SIZES)}"
        )


def model_device(model: Model) -> torch.device:
    """Where the loaded networks are; the CPU while there are none."""
    for _, part in model.networks.parts():
        return next(part.parameters()).device
    return torch.device("cpu")
