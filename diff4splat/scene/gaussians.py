"""An unordered set of anisotropic 3D Gaussians.

Axes: ``n`` Gaussians, ``k`` spherical-harmonic coefficients (1, 4, 9 or 16).
Lengths in scene units. Quaternions are (w, x, y, z); scales are standard deviations, never
logarithms; opacities are probabilities, never logits. Colour is 0.5 + Σ_k sh_k Y_k(direction),
sRGB-referred (Kerbl et al., SIGGRAPH 2023).
"""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.scene.harmonics import BAND_SIZES


@dataclass(frozen=True, slots=True, kw_only=True)
class Gaussians:
    """Canonical Gaussians in world space, with activated values."""

    means: Float[Tensor, "n 3"]
    quats: Float[Tensor, "n 4"]
    scales: Float[Tensor, "n 3"]
    opacities: Float[Tensor, " n"]
    sh: Float[Tensor, "n k 3"]

    def __post_init__(self) -> None:
        count = tuple(self.opacities.shape)
        want = {"means": (*count, 3), "quats": (*count, 4), "scales": (*count, 3)}
        for name, shape in want.items():
            got = tuple(getattr(self, name).shape)
            if got != shape:
                raise ShapeError(f"Gaussians.{name}: expected {shape} (from opacities), got {got}")
        got = tuple(self.sh.shape)
        if len(got) != 3 or got[:1] != count or got[1] not in BAND_SIZES or got[2] != 3:
            raise ShapeError(f"Gaussians.sh: expected {(*count, '1, 4, 9 or 16', 3)}, got {got}")

    def __len__(self) -> int:
        return self.opacities.shape[0]

    @property
    def degree(self) -> int:
        """Highest spherical-harmonic degree, 0 for plain colour."""
        return BAND_SIZES.index(self.sh.shape[1])

    def select(self, index: Bool[Tensor, " n"] | Int[Tensor, " m"] | slice) -> "Gaussians":
        """The Gaussians under a mask or at indices; those of a slice share storage."""
        return replace(self, **{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def to(self, target: torch.device | torch.dtype) -> "Gaussians":
        """Move or cast every tensor; shares storage where nothing changes."""
        return replace(self, **{f.name: getattr(self, f.name).to(target) for f in fields(self)})


def concatenate(parts: list[Gaussians]) -> Gaussians:
    """One set from several; all must have the same harmonic degree."""
    degrees = {part.degree for part in parts}
    if len(degrees) != 1:
        raise ShapeError(f"concatenate: expected one harmonic degree, got {sorted(degrees)}")
    return Gaussians(
        **{f.name: torch.cat([getattr(p, f.name) for p in parts]) for f in fields(Gaussians)}
    )
