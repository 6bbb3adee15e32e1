"""PyTorch networks of a model: stored weights, and random ones where there are none."""

import os
from collections.abc import Collection
from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import SIZES
from diff4splat.models.factory import create_networks, parameter_counts
from diff4splat.models.hub.folders import require_files, require_parts
from diff4splat.models.hub.provenance import read_provenance
from diff4splat.models.hub.weight_files import has_weights
from diff4splat.models.hub.weights import load_networks
from diff4splat.models.networks import Networks
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE, Tokenizer
from diff4splat.models.wan.umt5 import Umt5Encoder

BYTES_PER_WEIGHT = 4


def torch_networks(config: ModelConfig, folder: Path | None, parts: Collection[str]) -> Networks:
    """``parts`` of the model in ``folder``; random ones without a folder.

    Raises:
        ConfigError: more weights than this machine's memory holds.
        CheckpointError: weights and configuration do not belong together.
        FileFormatError: a file is damaged.
    """
    if folder is None:
        _require_memory(config, parts)
        return create_networks(config, parts=parts)
    require_parts(folder, parts)
    may_lack = read_provenance(folder).may_lack
    drawn = [part for part in parts if part in may_lack and not has_weights(folder, part)]
    _require_memory(config, drawn)
    networks = load_networks(folder, config, parts, may_lack)
    if isinstance(networks.text_encoder, Umt5Encoder) and "text_encoder" not in drawn:
        require_files(folder, (TOKENIZER_FILE,))
        longest = config.dit.padded_text_tokens
        networks.text_encoder.tokenizer = Tokenizer(
            folder / TOKENIZER_FILE, longest, cleans=config.text.encoder == "umt5"
        )
    return networks


def _require_memory(config: ModelConfig, drawn: Collection[str]) -> None:
    if not drawn:
        return
    counts = parameter_counts(config)
    needed = sum(counts[part] for part in drawn) * BYTES_PER_WEIGHT
    present = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > 0.8 * present:
        raise ConfigError(
            f"model {config.name!r}: expected at least {needed / 0.8 / 2**30:.0f} GiB of memory "
            f"for its weights, got {present / 2**30:.0f} GiB; choose another of {', '.join(SIZES)}"
        )
