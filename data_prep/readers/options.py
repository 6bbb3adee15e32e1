"""Options for reading a capture, equal for all formats."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from diff4splat.errors import ConfigError
from diff4splat.paths.messages import unknown_name

FormatName = Literal["dnerf", "neu3d", "hypernerf", "colmap", "transforms", "clips", "cameras"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Options of a reader; None selects the default of the format."""

    format: str = "auto"
    """``auto`` detects the format, otherwise a ``FormatName``."""
    hold_out: tuple[int, ...] | None = None
    """Cameras to hold out, counted from 0 in the order of their names. D-NeRF counts files instead:
    1 is val, 2 is test."""
    downscale: int = 1
    """Downscale factor; blocks of pixels are averaged."""
    frame_step: int = 1
    """Use every n-th time."""
    background: tuple[float, float, float] | None = None
    """RGB in [0, 1] behind transparent pixels. None is white for D-NeRF; elsewhere it makes
    transparent pixels invalid."""
    fps: float | None = None
    """For formats that count frames instead of seconds."""
    clip: str | None = None
    """Which clip of a folder of shards, or which effect of data sets of cameras."""

    def __post_init__(self) -> None:
        if self.format not in ("auto", *get_args(FormatName)):
            names = ("auto", *get_args(FormatName))
            raise ConfigError(unknown_name("format", self.format, names))
        for name in ("downscale", "frame_step"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name}: expected at least 1, got {getattr(self, name)}")
        if self.fps is not None and not (math.isfinite(self.fps) and self.fps > 0):
            raise ConfigError(f"fps: expected a finite rate above 0, got {self.fps:g}")
        if self.background is not None and not all(0 <= level <= 1 for level in self.background):
            raise ConfigError(f"background: expected RGB from 0 to 1, got {self.background}")
