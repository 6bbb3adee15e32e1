"""Raw deformation maps to what a key-framed motion stores.

Axes: ``t h w`` grid of the Gaussians, ``n`` all of them in that order, ``m`` selected ones, ``k``
key times. Deformation of Diff4Splat, with the convention of ``scene/motion/keyframes.py``:

    offset = raw · length_unit     rotation = normalize((1, 0, 0, 0) + raw), canonical on the left
    log_scale_offset = log scale(raw_scale + raw) − log scale(raw_scale): s_0 + Δs in raw space
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.models.config.networks import DEFORMATION_SPLIT, GAUSSIAN_SPLIT, ActivationConfig
from diff4splat.models.ldrm import activations
from diff4splat.scene.motion.keyframes import KeyframeMotion


@dataclass(frozen=True, slots=True, kw_only=True)
class DeformationState:
    """How the selected Gaussians differ from the canonical ones at one time."""

    offsets: Float[Tensor, "m 3"]
    rotations: Float[Tensor, "m 4"]
    log_scale_offsets: Float[Tensor, "m 3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeformationUnits:
    """What turns raw deformation channels into scene units."""

    length_unit: float
    """Scene length of a raw offset of 1, such as the median base distance."""
    activation: ActivationConfig


def raw_scales(raw_gaussians: Float[Tensor, "12 t h w"]) -> Float[Tensor, "n 3"]:
    """The scale channels of the reconstruction maps, one row per Gaussian."""
    first = GAUSSIAN_SPLIT[0]
    return raw_gaussians[first : first + GAUSSIAN_SPLIT[1]].flatten(1).T


def deformation_state(
    raw: Float[Tensor, "10 t h w"],
    raw_scale: Float[Tensor, "m 3"],
    selected: Int[Tensor, " m"],
    units: DeformationUnits,
) -> DeformationState:
    """State of the Gaussians at indices ``selected`` from the maps of one query time.

    ``raw_scale`` holds the canonical raw scales of the same Gaussians.

    Raises:
        ShapeError: a tensor is in half precision, or the two selections differ in length.
    """
    activations.require_full_precision(raw, "raw deformation")
    if raw_scale.shape != (len(selected), 3):
        raise ShapeError(
            f"raw scales: expected {(len(selected), 3)} as selected, got {tuple(raw_scale.shape)}"
        )
    offset, turn, stretch = raw.flatten(1)[:, selected].T.split(DEFORMATION_SPLIT, -1)
    return DeformationState(
        offsets=offset * units.length_unit,
        rotations=activations.rotation(turn),
        log_scale_offsets=activations.stretch(stretch, raw_scale, units.activation.log_scale_limit),
    )


def keyframe_motion(
    states: list[DeformationState], key_times_s: Float[Tensor, " k"], selected: Int[Tensor, " m"]
) -> KeyframeMotion:
    """One motion from the states at the key times, in the same order."""
    return KeyframeMotion(
        key_times_s=key_times_s,
        moving_index=selected,
        offsets=torch.stack([state.offsets for state in states]),
        rotations=torch.stack([state.rotations for state in states]),
        log_scale_offsets=torch.stack([state.log_scale_offsets for state in states]),
    )
