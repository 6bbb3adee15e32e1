"""A model as it is loaded and saved: configuration, networks, and which of them are trained.

config.json  provenance.json  {vae,text_encoder,dit,ldrm,deformation}.safetensors  [SHA256SUMS]

A name is looked for as a folder first, then among the weights that ship, then among the sizes.
"""

import math
import os
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.sizes import SIZES, size_by_name
from diff4splat.models.factory import (
    PARTS,
    Networks,
    create_networks,
    create_text_encoder,
    parameter_counts,
)
from diff4splat.models.hub.bundled_weights import bundled_folder
from diff4splat.models.hub.checksums import SUMS_FILE, require_whole
from diff4splat.models.hub.provenance import (
    NOT_STATED,
    PROVENANCE_FILE,
    ModelProvenance,
    read_provenance,
    write_provenance,
)
from diff4splat.models.hub.weights import (
    CONFIG_FILE,
    load_config,
    load_networks,
    load_text_encoder,
    part_file,
    save_networks,
    weights_sha256,
)

BYTES_PER_WEIGHT = 4
BASE_SIDE_PX = 256
"""Picture side where no network runs, or where pixels take after what networks see in a smaller
copy: nothing then asks for the size that they were made for."""
RECONSTRUCTION = frozenset({"vae", "ldrm", "deformation"})
"""Parts between a true video and its scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Everything a pipeline needs. The text encoder is absent until a prompt asks for it."""

    config: ModelConfig
    networks: Networks
    folder: Path | None = None
    """Where the weights lie; None for random ones."""
    weights_sha256: str = "none"
    trained: frozenset[str] = frozenset()
    """Names of the parts that are trained to their end."""
    license: str = NOT_STATED
    origin: str = NOT_STATED

    @property
    def untrained(self) -> bool:
        """Whether anything that generation needs is not trained."""
        return not self.trained.issuperset(PARTS)

    @property
    def reconstructs(self) -> bool:
        """Whether everything between a true video and its scene is trained."""
        return self.trained.issuperset(RECONSTRUCTION)

    @property
    def runs_video_model(self) -> bool:
        """Whether generation samples a video and reconstructs it, or shows the base scene.

        An untrained video model gives noise, and trained heads would make a scene of it. So where
        some parts are trained but not the video model, it and the heads stay out of generation.
        Where nothing is trained everything runs: fresh heads answer zero to any video, which is
        the base scene too, and heads that somebody set by hand are seen. A detail decoder would
        show decoded noise, so with one the video model must be trained.
        """
        return _runs_video_model(self.config, self.trained)

    @property
    def tells_motion(self) -> bool:
        """Whether the video model says where things go and sees a draft of the rest."""
        return self.config.dit.motion and self.config.dit.draft

    @property
    def branches_motion(self) -> bool:
        """Whether motion is told by a branch of its own, so that no video need be sampled."""
        return self.tells_motion and self.config.dit.motion_width > 0

    @property
    def side_px(self) -> int:
        """Longer side of pictures read from files."""
        return _side_px(self.config, self.trained)

    def pixels_per_cell(self, size_px: tuple[int, int]) -> int:
        """Pixels of a picture per pixel side that the networks see of it.

        Of those that leave whole tokens the one with which networks see most nearly as many pixels
        as they were made for.
        """
        side_px = math.sqrt(math.prod(size_px))
        wanted = _pixels_per_cell(self.config, self.trained, side_px)
        if wanted == 1:
            return 1
        token_px, own_px = self.config.token_px, max(self.config.size_px)
        counts = [
            count
            for count in range(1, 2 * wanted)
            if not any(side % (count * token_px) for side in size_px)
        ]
        return min(counts, key=lambda count: abs(math.log(side_px / own_px / count)), default=1)

    @property
    def device(self) -> torch.device:
        """Where the networks are."""
        return next(self.networks.dit.parameters()).device


def load_model(name_or_folder: str | Path) -> Model:
    """A model folder, or a size with its shipped or else random weights; no text encoder.

    Parts that the provenance does not call trained may have no file: they are random then.

    Raises:
        ConfigError: neither a folder nor a size, or more than this machine's memory.
        CheckpointError: weights and configuration do not belong together.
        FileFormatError: a file is damaged.
    """
    folder = checked_folder(name_or_folder)
    if folder is None:
        config = size_by_name(str(name_or_folder))
        _require_memory(config)
        return Model(config=config, networks=create_networks(config, with_text=False))
    provenance = read_provenance(folder)
    config, networks = load_networks(folder, with_text=False, may_lack=provenance.may_lack)
    return Model(
        config=config,
        networks=networks,
        folder=folder,
        weights_sha256=weights_sha256(folder),
        trained=provenance.trained,
        license=provenance.license,
        origin=provenance.origin,
    )


def checked_folder(name_or_folder: str | Path, names: Collection[str] | None = None) -> Path | None:
    """The folder that ``load_model`` reads; None where weights would be random, or for no size.

    Shipped folders have checksums, others may; with ``names`` only those files are compared.

    Raises:
        FileFormatError: a file is damaged.
    """
    given = Path(name_or_folder)
    shipped = None if _is_folder(given) else bundled_folder(str(name_or_folder))
    if shipped is not None:
        require_whole(shipped, "install diff4splat again", names)
        return shipped
    if not _is_folder(given):
        return None
    if (given / SUMS_FILE).is_file():
        require_whole(given, "fetch the model again", names)
    return given


def find_config(name_or_folder: str | Path) -> ModelConfig:
    """The configuration alone, without any weights.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    folder = checked_folder(name_or_folder, (CONFIG_FILE,))
    return size_by_name(str(name_or_folder)) if folder is None else load_config(folder)


def find_side_px(name_or_folder: str | Path) -> int:
    """``Model.side_px`` without any weights.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    folder = checked_folder(name_or_folder, (CONFIG_FILE, PROVENANCE_FILE))
    trained = frozenset() if folder is None else read_provenance(folder).trained
    return _side_px(find_config(name_or_folder), trained)


def find_multiple_px(name_or_folder: str | Path, side_px: int) -> int:
    """What sides of pictures of about ``side_px`` must be multiples of, without any weights.

    Raises:
        ConfigError, CheckpointError, FileFormatError: as ``load_model``.
    """
    folder = checked_folder(name_or_folder, (CONFIG_FILE, PROVENANCE_FILE))
    trained = frozenset() if folder is None else read_provenance(folder).trained
    config = find_config(name_or_folder)
    return config.token_px * _pixels_per_cell(config, trained, side_px)


def with_text_encoder(model: Model) -> Model:
    """The same model with its text encoder; the other networks are shared."""
    if model.networks.text_encoder is not None:
        return model
    if model.folder is None or _has_no_text_encoder(model.folder):
        encoder = create_text_encoder(model.config)
    else:
        encoder = load_text_encoder(model.folder, model.config)
    return replace(model, networks=replace(model.networks, text_encoder=encoder.to(model.device)))


def save_model(model: Model, folder: Path) -> None:
    """Write a folder that ``load_model`` reads, text encoder included, without checksums."""
    complete = with_text_encoder(model)
    write_provenance(
        ModelProvenance(trained=model.trained, license=model.license, origin=model.origin), folder
    )
    # Checksums of what lay there before would call the new files damaged.
    (folder / SUMS_FILE).unlink(missing_ok=True)
    save_networks(complete.networks, model.config, folder)


def _runs_video_model(config: ModelConfig, trained: frozenset[str]) -> bool:
    if "dit" in trained:
        return True
    return not trained and not config.detail.used


def _side_px(config: ModelConfig, trained: frozenset[str]) -> int:
    own_px = max(config.size_px)
    if _runs_video_model(config, trained) and not config.detail.used:
        return own_px
    return max(own_px, BASE_SIDE_PX)


def _pixels_per_cell(config: ModelConfig, trained: frozenset[str], side_px: int | float) -> int:
    """With a detail decoder every pixel of the first frame has a Gaussian to take after."""
    if not (config.detail.used and _runs_video_model(config, trained)):
        return 1
    return max(round(side_px / max(config.size_px)), 1)


def _is_folder(folder: Path) -> bool:
    try:
        return folder.is_dir()
    except OSError:
        return False  # longer than any name


def _has_no_text_encoder(folder: Path) -> bool:
    lacking = "text_encoder" in read_provenance(folder).may_lack
    return lacking and not part_file(folder, "text_encoder").is_file()


def _require_memory(config: ModelConfig) -> None:
    needed = sum(parameter_counts(config).values()) * BYTES_PER_WEIGHT
    present = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed > 0.8 * present:
        raise ConfigError(
            f"model {config.name!r}: expected at least {needed / 0.8 / 2**30:.0f} GiB of memory "
            f"for its weights, got {present / 2**30:.0f} GiB; choose another of {', '.join(SIZES)}"
        )
