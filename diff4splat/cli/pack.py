"""``diff4splat pack``: export a trained model as a small folder."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import OutFolder
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.errors import ConfigError

MEGABYTE = 1e6


@dataclass(frozen=True, kw_only=True)
class Pack:
    """Write the trained parts of a model in half precision or less, with provenance and sums."""

    model: Annotated[Path, tyro.conf.Positional]
    """Model folder, such as run/model."""
    out: OutFolder
    """Folder for the exported model; an existing CARD.md is kept."""
    parts: tuple[str, ...] = ()
    """Parts to export, such as vae ldrm. Default: all parts whose training is complete."""
    eight_bit: tuple[str, ...] = ()
    """Parts to store in eight bits, half the size, such as dit."""
    license: str = "not stated"
    """Licence of the weights, as an SPDX name such as Apache-2.0."""
    origin: str = "not stated"
    """Origin of the weights, in one line."""

    def run(self) -> None:
        """Check, write, and print the size of each part."""
        from diff4splat.cli.common.console import note
        from diff4splat.models.hub.export import export_model
        from diff4splat.models.hub.model import load_model

        packed = export_model(
            load_model(self.model),
            self.out,
            license=self.license,
            origin=self.origin,
            parts=self.parts or None,
            eight_bit=self.eight_bit,
        )
        total = sum(packed.bytes_by_part.values())
        for name, size in {**packed.bytes_by_part, "total": total}.items():
            print(f"{name:<16}{size / MEGABYTE:>9.3f} MB")
        print(f"{'weights_sha256':<16}{packed.weights_sha256}")
        note(f"wrote {self.out}")

    def check(self) -> None:
        """Reject bad arguments before anything is read.

        Raises:
            ConfigError: no model folder, output equal to input, or text of several lines.
        """
        if not self.model.is_dir():
            raise ConfigError(
                f"{self.model}: expected a model folder, got none; `diff4splat train` writes one"
            )
        require_inputs_not_overwritten((self.model,), (self.out,))
        for name, value in (("--license", self.license), ("--origin", self.origin)):
            if not value.strip() or len(value.splitlines()) > 1:
                raise ConfigError(f"{name}: expected one line of text, got {value!r}")
