"""A model as it is loaded and saved: configuration, the networks loaded so far, what is trained.

config.json  provenance.json  <part>.safetensors  [SHA256SUMS]
"""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import torch

from diff4splat.errors import ConfigError
from diff4splat.io.atomic import copy_file
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.locks import sole_writer
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.config.tuning import ADAPTER_FILE
from diff4splat.models.hub.checksums import SUMS_FILE
from diff4splat.models.hub.folders import checked_folder
from diff4splat.models.hub.provenance import (
    NOT_STATED,
    PROVENANCE_FILE,
    ModelProvenance,
    read_provenance,
    write_provenance,
)
from diff4splat.models.hub.weight_files import (
    CONFIG_FILE,
    load_config,
    part_file,
    weights_sha256,
)
from diff4splat.models.networks import Networks, model_parts
from diff4splat.models.onnx.manifest import has_graphs, read_manifest

Runtime = Literal["torch", "onnx"]
ADAPTED = "dit"
"""The part that adapters are for."""


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
    adapter: Path | None = None
    """Folder of what a stage taught the video model beside its own weights."""

    @property
    def runtime(self) -> Runtime:
        """What runs the networks: PyTorch, or ONNX Runtime where the folder holds graphs."""
        return "onnx" if self.folder is not None and has_graphs(self.folder) else "torch"

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
        if self.runtime == "onnx":
            return read_manifest(self.folder).weights_sha256(parts)
        wanted = self.parts if parts is None else parts
        files = weights_sha256(self.folder, wanted)
        if self.adapter is None or ADAPTED not in wanted:
            return files
        digests = f"{files}\n{file_sha256(self.adapter / ADAPTER_FILE)}\n"
        return hashlib.sha256(digests.encode()).hexdigest()


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
    fresh = _networks(model, missing)
    if model.adapter is not None and ADAPTED in missing:
        _adapt(fresh, model.adapter)
    return replace(model, networks=replace(model.networks, **dict(fresh.parts())))


def with_adapter(model: Model, folder: Path) -> Model:
    """The same model, whose video model gets the weights of an adapter folder when it is loaded.

    Raises:
        ConfigError: the model runs ONNX graphs, or its video model is loaded already.
    """
    if model.runtime == "onnx" or ADAPTED in model.loaded:
        raise ConfigError(
            "adapter: expected a model of PyTorch weights whose video model is not loaded yet, "
            f"got {model.folder}; name its folder instead"
        )
    return replace(model, adapter=folder)


def _adapt(networks: Networks, folder: Path) -> None:
    from diff4splat.models.adapters.adapter_file import put_adapter

    put_adapter(networks.dit, folder)
    networks.dit.requires_grad_(False)


def _networks(model: Model, parts: Collection[str]) -> Networks:
    """Each runtime's code is imported only where it runs."""
    if model.runtime == "onnx":
        from diff4splat.models.onnx.networks import onnx_networks

        return onnx_networks(model.folder, parts)
    from diff4splat.models.hub.torch_networks import torch_networks

    return torch_networks(model.config, model.folder, parts)


def parameter_counts(model: Model) -> Mapping[str, int]:
    """Trainable weights per part, loaded or not."""
    if model.runtime == "onnx":
        return read_manifest(model.folder).parameter_counts
    from diff4splat.models.factory import parameter_counts as built_counts

    return built_counts(model.config)


def save_model(model: Model, folder: Path, kept: Mapping[str, Path] | None = None) -> None:
    """Write a folder that ``load_model`` reads, all parts included, without checksums.

    Files in ``kept``, by their names in the folder, are taken over as they are; a part that has
    one is not loaded.
    Another process that writes there, such as a stage that ends at the same time, is waited for.
    """
    from diff4splat.models.hub.weights import save_networks

    if model.runtime == "onnx":
        raise ConfigError(
            "save: expected a model of PyTorch weights, got one of ONNX graphs; copy its folder"
        )
    kept = kept or {}
    written = [part for part in model.parts if part_file(folder, part).name not in kept]
    complete = with_parts(model, written)
    provenance = ModelProvenance(trained=model.trained, license=model.license, origin=model.origin)
    with sole_writer(folder, wait=True):
        write_provenance(provenance, folder)
        # Checksums of the files before would call the new ones damaged.
        (folder / SUMS_FILE).unlink(missing_ok=True)
        for name, source in kept.items():
            copy_file(source, folder / name)
        save_networks(complete.networks, model.config, folder, only=written)


def model_device(model: Model) -> torch.device:
    """Where the loaded networks are; the CPU while there are none."""
    for _, part in model.networks.parts() if model.runtime == "torch" else ():
        return next(part.parameters()).device
    return torch.device("cpu")
