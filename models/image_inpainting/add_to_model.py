"""A model folder with the public inpainting network beside its own."""

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.io.atomic import atomic_folder
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.priors import ImageInpaintingConfig
from diff4splat.models.hub.checksums import SUMS_FILE, listed_files, write_sums
from diff4splat.models.hub.provenance import (
    PROVENANCE_FILE,
    ModelProvenance,
    read_provenance,
    write_provenance,
)
from diff4splat.models.hub.weight_files import load_config, part_file
from diff4splat.models.hub.weights import save_networks
from diff4splat.models.image_inpainting.network import ImageInpainting
from diff4splat.models.image_inpainting.public_weights import WIDTHS
from diff4splat.models.networks import Networks

PART = "image_inpainting"
LICENSE, ORIGIN = "MIT", f"{PART} is MI-GAN (MIT, Places2)"


def add_public_inpainting(model: Path, weights: Mapping[str, Tensor], out: Path) -> None:
    """Write the model folder with ``weights`` in eight bits, whole or not at all.

    Raises:
        ConfigError: the model has such a network.
        CheckpointError, FileFormatError: its configuration or its provenance cannot be read.
        OutputError: the folder cannot be written.
    """
    config, provenance = load_config(model), read_provenance(model)
    if config.image_inpainting.used:
        raise ConfigError(f"{model}: expected a model without {PART}, got one with it")
    owned = [file.name for file in listed_files(model)]
    with atomic_folder(out, (*owned, SUMS_FILE, part_file(out, PART).name)) as staging:
        for name in owned:
            shutil.copyfile(model / name, staging / name)
        save_networks(_networks(weights), _with_part(config), staging, eight_bit=(PART,))
        if (model / PROVENANCE_FILE).is_file():
            write_provenance(_with_origin(provenance), staging)
        write_sums(staging)


def _networks(weights: Mapping[str, Tensor]) -> Networks:
    network = ImageInpainting(WIDTHS)
    network.load_state_dict(weights)
    return Networks(image_inpainting=network)


def _with_part(config: ModelConfig) -> ModelConfig:
    return replace(config, image_inpainting=ImageInpaintingConfig(widths=WIDTHS))


def _with_origin(provenance: ModelProvenance) -> ModelProvenance:
    trained = provenance.trained | {PART}
    may_lack = provenance.may_lack - {PART}
    return replace(
        provenance,
        trained=trained,
        may_lack=may_lack,
        license=f"{provenance.license} AND {LICENSE}",
        origin=f"{provenance.origin}; {ORIGIN}",
    )
