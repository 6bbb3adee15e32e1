"""``diff4splat models import`` and ``models check``: a public video model as a model folder."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.errors import ConfigError

PIECES = 400
"""Steps of the progress bar."""


@dataclass(frozen=True, kw_only=True)
class ImportModel:
    """Make a model folder of public weights: Wan 2.1, Wan 2.2, CogVideoX or CogVideoX 1.5."""

    folder: Annotated[
        Path,
        tyro.conf.Positional,
        InputPath(what="a model folder in the layout of diffusers", file=False),
    ]
    """Downloaded folder with model_index.json, transformer, vae, text_encoder and tokenizer."""
    out: OutFolder
    """Folder for the model; as large as the weights."""
    reconstruction: str = "paper"
    """Size whose LDRM and deformation network the model gets, untrained: paper or test."""
    frames: Annotated[int, Number(least=1, most=1000)] = 49
    """Frames per video, 1 + 4 k."""
    size: str | None = None
    """Height and width of the video, such as 480x832. Default: what the weights were trained at."""
    tile: str | None = None
    """Height and width of the tiles in which the autoencoder of CogVideoX works on larger frames,
    such as 240x360: less memory, other rounding. Default: whole frames."""
    license: str = "not stated"
    """Licence of the weights, as an SPDX name; Wan and CogVideoX-2B are Apache-2.0."""

    def check(self) -> None:
        """Refuse sizes that are none, and an output inside the input.

        Raises:
            ConfigError: a size that is none, or no such size of networks.
        """
        from diff4splat.models.config.sizes import size_by_name

        require_inputs_not_overwritten((self.folder,), (self.out,))
        size_by_name(self.reconstruction)
        self.size_px()
        self.tile_px()

    def size_px(self) -> tuple[int, int] | None:
        """(height, width) of the video."""
        return _sides("--size", self.size)

    def tile_px(self) -> tuple[int, int] | None:
        """(height, width) of tiles."""
        return _sides("--tile", self.tile)

    def run(self) -> None:
        """Check everything, then copy."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.models.public_weights.import_model import (
            ImportOptions,
            open_public_model,
            write_model,
        )

        settings = ImportOptions(
            reconstruction=self.reconstruction,
            frames=self.frames,
            size_px=self.size_px(),
            tile_px=self.tile_px(),
        )
        phases = ConsolePhases()
        with phases.phase("check files"):
            model = open_public_model(self.folder, settings)
        with phases.phase("copy weights", PIECES) as advance:
            write_model(model, self.out, self.license, _by_bytes(advance, model.size))
        print(model.summary())
        note(f"wrote {self.out}; diff4splat generate photo.jpg --model {self.out} --fill video")


@dataclass(frozen=True, kw_only=True)
class CheckModel:
    """Say whether a public model folder can be imported: every weight, every hash."""

    folder: Annotated[
        Path,
        tyro.conf.Positional,
        InputPath(what="a model folder in the layout of diffusers", file=False),
    ]
    """Downloaded folder."""

    def run(self) -> None:
        """Print what it holds."""
        from diff4splat.cli.common.console import ConsolePhases
        from diff4splat.models.public_weights.import_model import open_public_model

        with ConsolePhases().phase("check files"):
            model = open_public_model(self.folder)
        print(model.summary())


def _sides(option: str, text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    found = re.fullmatch(r"([1-9]\d{0,3})x([1-9]\d{0,3})", text)
    if not found:
        raise ConfigError(f"{option}: expected HEIGHTxWIDTH such as 480x832, got {text!r}")
    return int(found[1]), int(found[2])


def _by_bytes(advance: Callable[[], None], total: int) -> Callable[[int], None]:
    """Steps of a progress bar from bytes."""
    done = steps = 0

    def call(count: int) -> None:
        nonlocal done, steps
        done += count
        while steps < PIECES * done // max(total, 1):
            steps += 1
            advance()

    return call
