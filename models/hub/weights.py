"""Networks on disk: one ``.safetensors`` per part beside ``config.json``; never pickle.

    config.json  {vae,text_encoder,dit,ldrm,deformation,monocular_depth,motion_unet}.safetensors

Reading is strict: every key and every shape must be that of the configuration. Weights
may be stored in half precision or eight bits (``eight_bit.py``); they are read into float32,
but public ones are mapped (``mapped_weights.py``). Folders of version 1 are read too
(``legacy.py``). provenance.py decides which parts may be absent.
"""

from collections.abc import Collection
from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import Tensor, nn

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.io.atomic import atomic_path, write_text
from diff4splat.io.require_file import is_file
from diff4splat.io.scene_files.tensor_file import WEIGHT_DTYPES, read_tensors
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.eight_bit import from_eight_bits, to_eight_bits
from diff4splat.models.hub.legacy import upgrade_tensors
from diff4splat.models.hub.mapped_weights import map_weights, mapped_parts
from diff4splat.models.hub.weight_files import (
    CONFIG_FILE,
    has_weights,
    is_version_1,
    part_file,
    weight_file,
)
from diff4splat.models.networks import PARTS, Networks, model_parts

MAX_LISTED = 3
"""Names listed in an error message before "and so on"."""


def save_networks(
    networks: Networks,
    config: ModelConfig,
    folder: Path,
    dtype: torch.dtype = torch.float32,
    only: Collection[str] = PARTS,
    eight_bit: Collection[str] = (),
) -> None:
    """Write the parts in ``dtype`` or ``eight_bit``, and the configuration last.

    A folder with a configuration is complete.

    Raises:
        CheckpointError: a weight is NaN or infinite, in ``dtype``.
        OutputError: the folder cannot be written.
    """
    for name, part in networks.parts():
        if name not in only:
            continue
        tensors = {key: value.detach().cpu() for key, value in part.state_dict().items()}
        if name in eight_bit:
            tensors = to_eight_bits(tensors)
        else:
            tensors = {key: value.to(dtype).contiguous() for key, value in tensors.items()}
        _require_finite(tensors, name)
        with atomic_path(part_file(folder, name)) as temporary:
            _save_readable(tensors, temporary)
    write_text(folder / CONFIG_FILE, config.to_json())


def load_networks(
    folder: Path,
    config: ModelConfig,
    parts: Collection[str] | None = None,
    may_lack: Collection[str] = (),
) -> Networks:
    """The named parts of a model folder, or all, on the CPU in float32.

    Parts in ``may_lack`` that have no file get the random weights of ``create_networks``.

    Raises:
        CheckpointError: a file is absent, or keys or shapes do not belong to the configuration.
        FileFormatError: a file is damaged.
    """
    wanted = [part for part in model_parts(config) if parts is None or part in parts]
    drawn = {part for part in wanted if part in may_lack and not has_weights(folder, part)}
    stored = create_networks(config, "meta", parts=set(wanted) - drawn)
    mapped = mapped_parts(config)
    for name, part in stored.parts():
        if name in mapped:
            map_weights(part, name, part_file(folder, name))
        else:
            _fill(part, _read_part(folder, name, config), name)
    random = create_networks(config, parts=drawn)
    return Networks(**dict(stored.parts()), **dict(random.parts()))


def _read_part(folder: Path, part: str, config: ModelConfig) -> dict[str, Tensor]:
    tensors = _read(weight_file(folder, part))
    return upgrade_tensors(part, tensors, config) if is_version_1(folder) else tensors


def _read(path: Path) -> dict[str, Tensor]:
    if not is_file(path):
        raise CheckpointError(f"{path}: expected a weight file, got none; fetch the model again")
    try:
        return from_eight_bits(read_tensors(path, (*WEIGHT_DTYPES, "I8")))
    except FileFormatError as error:
        raise FileFormatError(
            f"{path}: expected safetensors, got a damaged file ({error}); fetch the model again"
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


def _refuse(keys: list[str], what: str) -> None:
    if keys:
        listed = ", ".join(keys[:MAX_LISTED]) + (", …" if len(keys) > MAX_LISTED else "")
        raise CheckpointError(
            f"{what} {len(keys)} ({listed}); the weights belong to another configuration"
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
