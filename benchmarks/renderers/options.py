"""What the command takes."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from timing.interleaved import Effort
from workers import memory

from diff4splat.errors import ConfigError

QUICK = ("cloud-10k-256", "cloud-100k-512", "aligned-256")
_MEMORY_SHARE = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Render the same scenes with every installed renderer, check the images, and compare."""

    scenes: tuple[str, ...] = QUICK
    """Names or patterns of scenes ("cloud-*"); "*" is all of them."""
    peers: tuple[str, ...] = ()
    """Renderers to compare; all of them when left out."""
    threads: tuple[int, ...] = field(default_factory=lambda: (os.cpu_count() or 1,))
    """Threads that each renderer computes with; several numbers measure each in turn."""
    seconds: float = 5.0
    """Time for the windows of one renderer on one scene."""
    patience: float = 30.0
    """A renderer whose first call takes longer is measured once only; after four times, stopped."""
    memory_gib: float | None = None
    """What one renderer may allocate; 60 % of what is free when left out."""
    plugins: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """A folder with more adapters. Its *.py files are run as they are: name only what you trust."""
    out: Path | None = None
    """Folder for results.json, table.md and the figures."""
    list: bool = False
    """Say which scenes and renderers there are, and stop."""
    slope: bool = False
    """Measure instead how our renderer's time grows with blended pairs."""

    def __post_init__(self) -> None:
        for name in ("seconds", "patience"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"--{name}: expected more than 0, got {getattr(self, name)}")
        if not self.threads or min(self.threads) < 1:
            raise ConfigError(f"--threads: expected numbers of at least 1, got {self.threads}")
        if self.memory_gib is not None and not self.memory_gib > 0:
            raise ConfigError(f"--memory-gib: expected more than 0, got {self.memory_gib}")

    def effort(self, checks: bool = True) -> Effort:
        """How long and how hard to measure."""
        if self.memory_gib is None:
            memory_bytes = int(_MEMORY_SHARE * memory.available_bytes())
        else:
            memory_bytes = int(self.memory_gib * 2**30)
        return Effort(
            seconds=self.seconds,
            patience_s=self.patience,
            memory_bytes=memory_bytes,
            checks=checks,
        )
