"""A trained model as a folder to share: trained parts in half precision or less, with sums.

    RUN/model (float32, all parts) ─► config.json  provenance.json  <part>.safetensors  SHA256SUMS

Half precision keeps eleven bits: weights change by at most 1/2048 of themselves, and those below
6e-8 vanish. Weights above 65504 do not fit and are refused. A model card in the target folder
is kept.
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from diff4splat.errors import CheckpointError, ConfigError
from diff4splat.io.atomic import atomic_folder
from diff4splat.models.hub.checksums import SUMS_FILE, write_sums
from diff4splat.models.hub.model import Model, with_parts
from diff4splat.models.hub.provenance import PROVENANCE_FILE, ModelProvenance, write_provenance
from diff4splat.models.hub.weight_files import CONFIG_FILE, has_weights, part_file, weights_sha256
from diff4splat.models.hub.weights import save_networks
from diff4splat.models.networks import PARTS

PACKED_TYPE = torch.float16
LARGEST = torch.finfo(PACKED_TYPE).max


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """What was written."""

    bytes_by_part: dict[str, int]
    weights_sha256: str


def export_model(
    model: Model,
    folder: Path,
    *,
    license: str,
    origin: str,
    parts: Collection[str] | None = None,
    eight_bit: Collection[str] = (),
) -> Packed:
    """Write ``parts`` of a model, or its trained ones, and nothing of the others.

    Those in ``eight_bit`` take half the room (``models.hub.eight_bit``).

    Raises:
        ConfigError: nothing is trained, or a named part has only random weights.
        CheckpointError: a weight does not fit into half precision.
        OutputError: the folder cannot be written.
    """
    chosen = frozenset(model.trained if parts is None else parts)
    _require_weights(model, chosen)
    _require_written(eight_bit, chosen)
    complete = with_parts(model, chosen)
    named = [(name, part) for name, part in complete.networks.parts() if name in chosen]
    for name, part in named:
        require_half_precision(part, name)
    provenance = ModelProvenance(trained=chosen, license=license, origin=origin)
    owned = (CONFIG_FILE, PROVENANCE_FILE, SUMS_FILE, *(part_file(Path(), p).name for p in PARTS))
    with atomic_folder(folder, owned) as staging:
        save_networks(complete.networks, model.config, staging, PACKED_TYPE, chosen, eight_bit)
        write_provenance(provenance, staging)
        write_sums(staging)
        sizes = {name: part_file(staging, name).stat().st_size for name, _ in named}
        return Packed(bytes_by_part=sizes, weights_sha256=weights_sha256(staging))


def require_half_precision(part: nn.Module, name: str) -> None:
    """Every weight is finite, also in half precision.

    Raises:
        CheckpointError: naming the first that is not.
    """
    for key, value in part.state_dict().items():
        if not bool(torch.isfinite(value.to(PACKED_TYPE)).all()):
            raise CheckpointError(
                f"{name} weights: expected numbers of at most {LARGEST:g} in {key}, "
                f"got {float(value.abs().max()):g}; half precision cannot hold them, train it again"
            )


def _require_written(eight_bit: Collection[str], chosen: Collection[str]) -> None:
    if others := sorted(set(eight_bit) - set(chosen)):
        raise ConfigError(
            f"eight bits: expected parts that are exported ({', '.join(sorted(chosen))}), "
            f"got {', '.join(others)}"
        )


def _require_weights(model: Model, chosen: Collection[str]) -> None:
    if not chosen:
        raise ConfigError(
            "model: expected trained parts, got none trained to its end; "
            "finish a stage of training, or name the parts"
        )
    for name in sorted(chosen):
        held = model.folder is not None and has_weights(model.folder, name)
        if name not in PARTS or not held:
            known = ", ".join(PARTS)
            raise ConfigError(
                f"part {name!r}: expected weights in the model folder, got none; "
                f"choose those that it has, of {known}"
            )
