"""Native 4D Gaussians from the unactivated tensors of the authors' program.

Axes: ``n`` Gaussians. Yang et al. (ICLR 2024, arXiv 2310.10642) keep logarithms of scales, logits
of opacities, and colours as one list with the index 16 · order in time + harmonic.
``native_4dgs_checkpoint`` reads their files.
"""

from dataclasses import dataclass, fields

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.scene.harmonics import BAND_SIZES
from diff4splat.scene.motion.spacetime_conversion import SpacetimeGaussians, split_orders
from diff4splat.scene.motion.spacetime_covariance import SpacetimeCovariance


@dataclass(frozen=True, slots=True, kw_only=True)
class RawSpacetime:
    """Unactivated values, in the shapes of the program's tensors."""

    positions: Float[Tensor, "n 3"]
    times_s: Float[Tensor, "n 1"]
    log_scales: Float[Tensor, "n 3"]
    log_time_scales: Float[Tensor, "n 1"]
    left_quats: Float[Tensor, "n 4"]
    right_quats: Float[Tensor, "n 4"]
    opacity_logits: Float[Tensor, "n 1"]
    constant_colors: Float[Tensor, "n 1 3"]
    """Their ``features_dc``: the first coefficient."""
    other_colors: Float[Tensor, "n r 3"]
    """Their ``features_rest``: all further coefficients."""


def from_raw_4d(raw: RawSpacetime) -> SpacetimeGaussians:
    """Activate the values, for ``to_spacetime``; needs 4D rotations (the program's ``rot_4d``).

    Raises:
        InputError: a number is not finite.
        ShapeError: the colours are not one, two or three orders of 16 harmonics, nor one order of
            1, 4 or 9.
    """
    _require_finite(raw)
    colors = torch.cat([raw.constant_colors, raw.other_colors], 1)
    count = colors.shape[1]
    covariance = SpacetimeCovariance(
        means=torch.cat([raw.positions, raw.times_s], -1),
        scales=torch.cat([raw.log_scales, raw.log_time_scales], -1).exp(),
        left_quats=raw.left_quats,
        right_quats=raw.right_quats,
    )
    return SpacetimeGaussians(
        covariance=covariance,
        opacities=raw.opacity_logits[:, 0].sigmoid(),
        orders=split_orders(colors, count if count in BAND_SIZES else BAND_SIZES[-1]),
    )


def _require_finite(raw: RawSpacetime) -> None:
    for field in fields(raw):
        value = getattr(raw, field.name)
        broken = int((~torch.isfinite(value)).sum())
        if broken:
            raise InputError(
                f"raw {field.name}: expected finite numbers, got {broken} of {value.numel()} that "
                "are not"
            )
