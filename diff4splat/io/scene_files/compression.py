"""How exactly a scene file keeps a scene; imports no library.

| name | what it keeps |
|---|---|
| ``lossless`` | every bit; version 1, which any reader of safetensors opens |
| ``standard`` | every number within ``Tolerances()``: nothing that can be seen changes |
| ``small`` | two to three times as far off |
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

Compression = Literal["lossless", "standard", "small"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Largest errors of stored numbers. Pixels are those of the scene's own camera path."""

    position_px: float = 0.02
    """Of centres, at all key times, seen from the nearest camera of the path."""
    rotation_px: float = 0.02
    """By which a rotation moves the ends of a Gaussian's longest axis, one deviation out."""
    log_scale: float = 0.005
    """Of logarithms of sizes and durations: half a percent."""
    opacity: float = 1 / 510
    color: float = 1 / 510
    """Of one harmonic's share of the colour, which is in [0, 1]."""
    field: float = 1 / 2048
    """Of features and weights of a motion field, as a share of the largest of their tensor."""


TOLERANCES: Mapping[str, Tolerances] = MappingProxyType(
    {
        "standard": Tolerances(),
        "small": Tolerances(
            position_px=0.06,
            rotation_px=0.06,
            log_scale=0.01,
            opacity=1 / 255,
            color=1 / 255,
            field=1 / 1024,
        ),
    }
)
"""Of every compression but ``lossless``."""
