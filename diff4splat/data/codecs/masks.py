"""``masks00.npz`` of one view: where sky is known to be, and what moves. Axes as in ``clip``."""

import numpy as np
import torch
from torch import Tensor

from diff4splat.data.clip import View
from diff4splat.data.codecs.npz import encode_npz, has_array, opened_npz, pack, take_bits
from diff4splat.data.entry import ClipEntry

NAMES = ("sky", "moving")
"""Fields of a view, and arrays of the archive."""


def has_masks(view: View) -> bool:
    """Whether there is something to store."""
    return any(getattr(view, name) is not None for name in NAMES)


def encode_masks(view: View) -> bytes:
    """The member's bytes; a mask that the view lacks has no array."""
    present = {name: getattr(view, name) for name in NAMES if getattr(view, name) is not None}
    return encode_npz({name: pack(mask.numpy()) for name, mask in present.items()})


def decode_masks(content: bytes, entry: ClipEntry) -> dict[str, Tensor]:
    """The masks of all frames, by name.

    Raises:
        FileFormatError: damaged, or of another size.
    """
    shape = (entry.frames, *entry.size_px)
    with opened_npz(content) as archive:
        found: dict[str, np.ndarray] = {
            name: take_bits(archive, name, shape) for name in NAMES if has_array(archive, name)
        }
    return {name: torch.from_numpy(mask) for name, mask in found.items()}
