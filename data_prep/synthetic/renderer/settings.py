"""What is drawn and how finely."""

from dataclasses import dataclass

from diff4splat.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawSettings:
    """Cost and extent of drawing; nothing here changes the truth at a pixel centre."""

    samples_per_side: int = 4
    """Visibility samples per pixel and axis, 1 to 7."""
    tracks: int = 512
    """Points to follow; 0 for none."""
    flow: bool = True
    shadow_px: int = 1024
    """Edge of the main light's shadow map; the one from above has half of it."""
    threads: int = 1
    """Frames drawn at once; no result depends on it."""

    def __post_init__(self) -> None:
        if not 1 <= self.samples_per_side <= 7:
            raise ConfigError(f"samples_per_side: expected 1 to 7, got {self.samples_per_side}")
        for name, low in (("tracks", 0), ("shadow_px", 16), ("threads", 1)):
            if getattr(self, name) < low:
                raise ConfigError(f"{name}: expected at least {low}, got {getattr(self, name)}")
