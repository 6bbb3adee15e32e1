"""Between RGB in [0, 1] and bytes."""

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor


def to_bytes(rgb: Float[Tensor, "*b"]) -> UInt8[np.ndarray, "*b"]:
    """Round to the nearest of 256 levels; NaN becomes 0 and everything else is clamped."""
    clamped = torch.nan_to_num(rgb.detach().cpu().float(), nan=0.0).clamp(0, 1)
    return (clamped * 255 + 0.5).to(torch.uint8).numpy()


def from_bytes(levels: UInt8[np.ndarray, "*b"]) -> Float[Tensor, "*b"]:
    """float32 in [0, 1]; the inverse of ``to_bytes``."""
    return torch.from_numpy(levels.astype(np.float32)) / 255


def unit_rgb(levels: UInt8[Tensor, "*b"]) -> Float[Tensor, "*b"]:
    """As ``from_bytes``, of a tensor on any device."""
    return levels.float() / 255
