"""An object of one image, cut out and put on another (copy-paste, arXiv 2012.07177).

Axes: ``h w`` pixels.
"""

from dataclasses import replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool, UInt8
from torch import Tensor

from diff4splat.data.clip_objects import PRESENT_SHARE, fills
from diff4splat.training.batches.requests.object_image import ObjectImage
from diff4splat.training.batches.requests.present import PresentObject

SCALES = (0.6, 1.6)
LARGEST_SIDE = 0.7
"""Of what is pasted, as a share of the image's."""


def paste(background: ObjectImage, other: ObjectImage, generator: torch.Generator) -> ObjectImage:
    """``background`` with one whole object of ``other`` in front, which does not move.

    Unchanged if ``other`` shows none whole.
    """
    whole = [one for one in other.objects if one.is_asked_for and not _is_cut(one.mask)]
    if not whole:
        return background
    one = whole[int(torch.randint(len(whole), (), generator=generator))]
    image, mask = _placed(other.image, one.mask, generator)
    covered = [replace(below, mask=below.mask & ~mask) for below in background.objects]
    pasted = PresentObject(named=one.named, mask=mask, moves=False)
    return ObjectImage(
        image=torch.where(mask[..., None], image, background.image),
        objects=[below for below in [*covered, pasted] if fills(below.mask, PRESENT_SHARE)],
    )


def _placed(
    image: UInt8[Tensor, "h w 3"], mask: Bool[Tensor, "h w"], generator: torch.Generator
) -> tuple[UInt8[Tensor, "h w 3"], Bool[Tensor, "h w"]]:
    """Image and mask, scaled and shifted so that the object is anywhere in the image."""
    y, x = (axis.double() for axis in mask.nonzero(as_tuple=True))
    center = np.array([float(x.min() + x.max()) / 2, float(y.min() + y.max()) / 2])
    sides = np.array([float(x.max() - x.min()) + 1, float(y.max() - y.min()) + 1])
    size = np.array(mask.shape[::-1], dtype=float)
    low, high = SCALES
    draws = torch.rand(3, generator=generator, dtype=torch.float64).numpy()
    scale = min(low * (high / low) ** draws[0], float((LARGEST_SIDE * size / sides).min()))
    margin = scale * sides / 2
    target = margin + draws[1:] * (size - 2 * margin)
    affine = np.array([[scale, 0, 0], [0, scale, 0]])
    affine[:, 2] = target - scale * center
    kinds = ((image.numpy(), cv2.INTER_LINEAR), (mask.numpy().astype(np.uint8), cv2.INTER_NEAREST))
    placed, covered = (
        torch.from_numpy(cv2.warpAffine(one, affine, mask.shape[::-1], flags=kind))
        for one, kind in kinds
    )
    return placed, covered > 0


def _is_cut(mask: Bool[Tensor, "h w"]) -> bool:
    """Whether it reaches the border of the image."""
    return bool(mask[0].any() | mask[-1].any() | mask[:, 0].any() | mask[:, -1].any())
