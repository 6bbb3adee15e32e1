"""Facts about the weights of a model folder or a size; files are checked, no network is built."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.hub.folders import checked_folder
from diff4splat.models.hub.provenance import ModelProvenance, read_provenance
from diff4splat.models.hub.weight_files import has_weights, load_config, weights_sha256
from diff4splat.models.networks import model_parts


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelInfo:
    """For people to read."""

    config: ModelConfig
    provenance: ModelProvenance
    states: Mapping[str, str]
    """Per part: trained, untrained (weights of unfinished training), or random (no weights)."""
    location: str
    """The folder, or that there is none."""
    weights_sha256: str


def model_info(name_or_folder: str | Path) -> ModelInfo:
    """Facts of what ``load_model`` would load.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    folder = checked_folder(name_or_folder)
    if folder is None:
        config = size_by_name(str(name_or_folder))
        return ModelInfo(
            config=config,
            provenance=ModelProvenance(),
            states=dict.fromkeys(model_parts(config), "random"),
            location="none: random weights",
            weights_sha256="none",
        )
    config, provenance = load_config(folder), read_provenance(folder)
    return ModelInfo(
        config=config,
        provenance=provenance,
        states={part: _state(folder, part, provenance) for part in model_parts(config)},
        location=str(folder),
        weights_sha256=weights_sha256(folder),
    )


def _state(folder: Path, part: str, provenance: ModelProvenance) -> str:
    if not has_weights(folder, part):
        return "random" if part in provenance.may_lack else "missing"
    return "trained" if part in provenance.trained else "untrained"
