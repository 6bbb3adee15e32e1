"""``diff4splat pack``: a trained model as a small folder that can be passed on or shipped."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.guard_overwrite import require_inputs_kept
from diff4splat.errors import ConfigError

MEGABYTE = 1e6


@dataclass(frozen=True, kw_only=True)
class Pack:
    """Write the trained parts of a model in half precision, with provenance and checksums."""

    model: Annotated[Path, tyro.conf.Positional]
    """A model folder, such as run/model."""
    out: Path
    """Folder for the packed model; a CARD.md that lies there stays."""
    parts: tuple[str, ...] = ()
    """Parts to pack, such as vae ldrm; if left out, those that are trained to their end."""
    license: str = "not stated"
    """Of the weights, as an SPDX name such as Apache-2.0."""
    origin: str = "not stated"
    """One line on where the weights come from."""

    def run(self) -> None:
        """Check, write, and print what each part takes."""
        from diff4splat.cli.console import note
        from diff4splat.models.hub.export import export_model
        from diff4splat.models.hub.model import load_model

        self._require_usable()
        packed = export_model(
            load_model(self.model),
            self.out,
            license=self.license,
            origin=self.origin,
            parts=self.parts or None,
        )
        total = sum(packed.bytes_by_part.values())
        for name, size in {**packed.bytes_by_part, "total": total}.items():
            print(f"{name:<16}{size / MEGABYTE:>9.3f} MB")
        print(f"{'weights_sha256':<16}{packed.weights_sha256}")
        note(f"wrote {self.out}")

    def _require_usable(self) -> None:
        """Refuse what cannot be packed, before anything is read.

        Raises:
            ConfigError: no model folder, a place that is the same, or words of several lines.
        """
        if not self.model.is_dir():
            raise ConfigError(
                f"{self.model}: expected a model folder, got none; `diff4splat train` writes one"
            )
        require_inputs_kept((self.model,), (self.out,))
        for name, value in (("--license", self.license), ("--origin", self.origin)):
            if not value.strip() or len(value.splitlines()) > 1:
                raise ConfigError(f"{name}: expected one line of text, got {value!r}")
