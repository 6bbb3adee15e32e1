"""What a moving object disoccludes, at the size of the image: static cells behind it (ours).

    pixels ─ what moves ─┬─ inverse depth of the static pixels around it, extended evenly
                         └─ colours: patches of the image, shifted (shift map of OpenCV)

Axes: ``h w`` pixels. The other layers continue the image in cells of the smaller copy, which blurs
every texture. Patches keep it.
"""

import math
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from diff4splat.generation.layered_image.background_layer import BEHIND
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.obliqueness import is_drawable
from diff4splat.generation.layered_image.types import NO_PIXEL, ImageLayer
from diff4splat.io.pixels import to_bytes

MARGIN_SHARE = 1 / 48
"""Of the image's longer side: near what moves, colours are mixed and shadows fall."""
FOOTPRINT_PX = 0.5
"""Standard deviation of a cell's Gaussian: without gaps between neighbours."""
DETAIL_SHARE = 1 / 16
"""Of the image's longer side: the window over whose mean detail is what remains."""
CONTEXT = (0.1, 1.0)
"""Where patches are sought above and below the hole, and beside it, over its longer side: what
stands on a ground stands there on either side."""
MAX_SIDE_PX = 192
"""Patches are sought in a copy of at most this side; twice the side takes eight times as long."""
SWEEPS = 40
"""Averages with the neighbours, per level of the pyramid."""


@torch.no_grad()
def disoccluded_layer(pixels: ImageLayer) -> ImageLayer | None:
    """The layer behind what moves of ``pixels``; None where nothing or almost everything does."""
    if pixels.displacement is None:
        return None
    moving = pixels.displacement.any(-1).any(0)
    margin_px = math.ceil(MARGIN_SHARE * max(moving.shape))
    known = ~grown(moving, margin_px)
    if not bool(moving.any()) or not bool(known.any()):
        return None
    depth = 1 / extended_evenly(1 / pixels.depth, known)
    return replace(
        pixels,
        rgb=textured(pixels.rgb, known),
        depth=torch.maximum(depth, BEHIND * pixels.depth),
        mask=grown(moving, 1) & is_drawable(pixels.camera),
        footprint_px=FOOTPRINT_PX,
        displacement=None,
        pixel_index=torch.full_like(pixels.pixel_index, NO_PIXEL),
        in_image=False,
    )


def extended_evenly(
    values: Float[Tensor, "h w"], known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """``values`` where ``known``, at least somewhere; else close to the mean of the neighbours.

    A coarse copy gives the start, and averaging does the rest: close to a membrane over the hole.
    """
    if bool(known.all()):
        return values
    if min(values.shape) > 1:
        size = [math.ceil(side / 2) for side in values.shape]
        share = _pooled(known.to(values))
        coarse = _pooled(torch.where(known, values, 0.0)) / share.clamp_min(1e-6)
        start = _enlarged(extended_evenly(coarse, share > 0), size, values.shape)
    else:
        start = values[known].mean().expand_as(values)
    filled = torch.where(known, values, start)
    for _ in range(SWEEPS):
        padded = torch.nn.functional.pad(filled[None, None], (1, 1, 1, 1), mode="replicate")[0, 0]
        mean = (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]) / 4
        filled = torch.where(known, values, mean)
    return filled


def textured(rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]) -> Float[Tensor, "h w 3"]:
    """``rgb`` where ``known``; else the colours around it extended evenly, with fine detail.

    Only the fine detail of patches is taken: whole ones may show another object.
    """
    even = torch.stack([extended_evenly(channel, known) for channel in rgb.unbind(-1)], -1)
    patched = filled_with_patches(rgb, known)
    return torch.where(known[..., None], rgb, even + patched - _blurred(patched)).clamp(0, 1)


def _blurred(rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
    half = math.ceil(DETAIL_SHARE * max(rgb.shape[:2]) / 2)
    return torch.nn.functional.avg_pool2d(
        rgb.movedim(-1, 0)[None], 2 * half + 1, 1, half, count_include_pad=False
    )[0].movedim(0, -1)


def filled_with_patches(
    rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    """``rgb`` with the rest of it in patches of what is ``known`` near the hole."""
    import cv2

    rows, columns = _window(~known)
    crop, mask = rgb[rows, columns], known[rows, columns]
    scale = min(1.0, MAX_SIDE_PX / max(mask.shape))
    size = [max(round(side * scale), 1) for side in reversed(mask.shape)]
    unknown = (~mask).cpu().numpy().astype(np.float32)
    small = cv2.resize(to_bytes(crop), size, interpolation=cv2.INTER_AREA)
    hole = cv2.resize(unknown, size, interpolation=cv2.INTER_AREA) > 0
    filled = cv2.resize(_patched(small, hole), mask.shape[::-1], interpolation=cv2.INTER_CUBIC)
    result = rgb.clone()
    colors = torch.from_numpy(filled).to(rgb) / 255
    result[rows, columns] = torch.where(mask[..., None], crop, colors)
    return result


def _patched(
    rgb: UInt8[np.ndarray, "h w 3"], hole: Bool[np.ndarray, "h w"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Shifted patches in the hole; where none fits, what is around it."""
    import cv2

    lab, patched = cv2.cvtColor(rgb, cv2.COLOR_RGB2Lab), np.zeros_like(rgb)
    shown = np.where(hole, 0, 255).astype(np.uint8)
    cv2.setRNGSeed(0)  # equal images are to give equal scenes
    cv2.xphoto.inpaint(lab, shown, patched, cv2.xphoto.INPAINT_SHIFTMAP)
    # It leaves zeros there, which are no colour: black has a and b in the middle of their range.
    missing = hole & (patched == 0).all(-1)
    result = cv2.cvtColor(patched, cv2.COLOR_Lab2RGB)
    return cv2.inpaint(result, missing.astype(np.uint8), 3, cv2.INPAINT_TELEA)


def _window(hole: Bool[Tensor, "h w"]) -> tuple[slice, slice]:
    """Rows and columns of the hole and of what is around it."""
    spans = [hole.any(1).nonzero()[:, 0], hole.any(0).nonzero()[:, 0]]
    longer = max(int(span[-1] - span[0]) + 1 for span in spans)
    around = [math.ceil(share * longer) for share in CONTEXT]
    return tuple(
        slice(max(int(span[0]) - more, 0), int(span[-1]) + 1 + more)
        for span, more in zip(spans, around, strict=True)
    )


def _pooled(values: Float[Tensor, "h w"]) -> Float[Tensor, "h2 w2"]:
    """Means of 2 × 2 cells; those at the border count what is there."""
    return torch.nn.functional.avg_pool2d(
        values[None, None], 2, ceil_mode=True, count_include_pad=False
    )[0, 0]


def _enlarged(
    values: Float[Tensor, "h2 w2"], size: list[int], shape: torch.Size
) -> Float[Tensor, "h w"]:
    even = (2 * size[0], 2 * size[1])
    large = torch.nn.functional.interpolate(
        values[None, None], size=even, mode="bilinear", align_corners=False
    )
    return large[0, 0, : shape[0], : shape[1]]
