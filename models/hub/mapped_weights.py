"""Large weights, mapped from their file instead of read.

Shapes and names are compared with the header before any weight is touched. Pages are read when a
block runs, and the system may drop them again: they take no memory that it cannot get back. Outside
the blocks, half precision is widened to float32; embeddings stay stored and are widened row by row.
"""

from pathlib import Path

import torch
from safetensors import safe_open
from torch import Tensor, nn

from diff4splat.errors import CheckpointError
from diff4splat.models.blocks.streamed_block import stream_blocks
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.public_weights.merge import match_keys
from diff4splat.models.public_weights.shard_files import read_header

STREAMED = ("dit", "text_encoder", "image_encoder")
"""Parts whose blocks are streamed."""
STORED = (".blocks.", ".embedding.")
"""In names of weights that keep their type."""


def mapped_parts(config: ModelConfig) -> frozenset[str]:
    """Parts whose weights are public ones."""
    public = {
        "vae": config.vae.layout != "plain",
        "text_encoder": config.text.encoder != "bytes",
        "dit": config.dit.padded_text_tokens > 0,
        "image_encoder": config.image_encoder.used,
    }
    return frozenset(part for part, holds in public.items() if holds)


def map_weights(part: nn.Module, name: str, file: Path) -> None:
    """Fill a network that lies on the meta device.

    Raises:
        CheckpointError: keys or shapes do not belong to the configuration, or no such file.
        FileFormatError: the file is damaged or cut off.
    """
    if not file.is_file():
        raise CheckpointError(f"{file}: expected a weight file, got none; import the model again")
    wanted = {key: tuple(value.shape) for key, value in part.state_dict().items()}
    match_keys(read_header(file), wanted, str, f"{name} weights")
    with safe_open(file, "pt") as opened:
        tensors = {key: _as_used(key, opened.get_tensor(key)) for key in wanted}
    part.load_state_dict(tensors, assign=True)
    part.requires_grad_(False)
    if name in STREAMED:
        # A part may consist of several networks.
        for network in (part, *part.children()):
            if hasattr(network, "blocks"):
                stream_blocks(network)


def _as_used(key: str, value: Tensor) -> Tensor:
    return value if _is_stored(key) else value.to(torch.float32)


def _is_stored(key: str) -> bool:
    return any(place in f".{key}" for place in STORED)


def resident_bytes(part: nn.Module) -> int:
    """Bytes of weights that are not mapped: what memory must hold in any case."""
    return sum(value.nbytes for key, value in part.state_dict().items() if not _is_stored(key))
