"""Colours of a disoccluded layer: an even surface with the fine detail of shifted patches (ours).

Axes: ``h w`` pixels of the image, ``hs ws`` of the smaller copy in which shifts are sought.
"""

import math

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import interpolate

from diff4splat.generation.layered_image.disoccluded.even_extension import even_colors
from diff4splat.generation.layered_image.disoccluded.shift_map import shift_map, source_pixels
from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.windows import (
    block_means,
    means_around,
    on_copy_of,
)

DETAIL_SHARE = 1 / 16
"""Of the image's longer side: the window over whose mean detail is what remains."""
SHAPE_STEP = 0.1
"""Difference of blurred colours at which another object begins, whose colours leave the mean."""
BLUR_PX = 2.5
"""Deviation of that blur, which texture does not survive."""
LIMIT = 2.0
"""Standard deviations of the detail beside the hole."""
LIKE_SIGMA = 0.12
"""Difference of mean colours with which a patch gives six tenths of its detail."""
CONTEXT = (0.1, 1.0)
"""Where patches are sought above and below the hole, and beside it, over its longer side: what
stands on a ground stands there on either side."""
MAX_SIDE_PX = 96
"""Shifts are sought in a copy of at most this side; patches keep all pixels of the image."""


def textured(rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]) -> Float[Tensor, "h w 3"]:
    """``rgb`` where ``known``; else the colours around it extended evenly, with fine detail.

    Only the fine detail of patches is taken: whole ones may show another object.
    """
    if bool(known.all()):
        return rgb
    return with_detail(rgb, known, even_colors(rgb, known))


def with_detail(
    rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"], even: Float[Tensor, "h w 3"]
) -> Float[Tensor, "h w 3"]:
    """``rgb`` where ``known``, not everywhere; else the ``even`` colours with fine detail."""
    detail, likeness = patch_detail(rgb, known, even)
    return torch.where(known[..., None], rgb, (even + detail * likeness).clamp(0, 1))


def patch_detail(
    rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"], even: Float[Tensor, "h w 3"]
) -> tuple[Float[Tensor, "h w 3"], Float[Tensor, "h w 1"]]:
    """Fine detail of shifted patches over ``even`` colours, and how alike their surfaces are.

    Not everything may be ``known``; detail is zero where it is.
    """
    rgb = torch.where(known[..., None], rgb, even)
    means = means_within_objects(rgb)
    rows, columns = _window(~known)
    detail = _bounded(torch.where(known[..., None], rgb - means, 0.0), known)
    shifts = _shifts(*(image[rows, columns] for image in (rgb, even, means, known)))
    around = means_around(rgb, DETAIL_SHARE)
    detail, of_patch = (
        _in_window(shifted(each[rows, columns], known[rows, columns], shifts), rows, columns, known)
        for each in (detail, around)
    )
    return detail, _likeness(around, of_patch)


def _in_window(
    values: Float[Tensor, "y x 3"], rows: slice, columns: slice, known: Bool[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    """Zero elsewhere."""
    whole = values.new_zeros(*known.shape, 3)
    whole[rows, columns] = values
    return whole


def _likeness(one: Float[Tensor, "h w 3"], other: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 1"]:
    """1 where mean colours are of one surface, 0 where they are of two."""
    difference = (one - other).square().mean(-1, keepdim=True)
    return torch.exp(-difference / (2 * LIKE_SIGMA**2))


def _shifts(
    rgb: Float[Tensor, "h w 3"],
    even: Float[Tensor, "h w 3"],
    means: Float[Tensor, "h w 3"],
    known: Bool[Tensor, "h w"],
) -> Int[Tensor, "h w 2"]:
    """Sought in a smaller copy."""
    step = math.ceil(max(known.shape) / MAX_SIDE_PX)
    complete = block_means(known[..., None].to(rgb), step)[..., 0] == 1
    found = shift_map(*(block_means(image, step) for image in (rgb, even, means)), complete)
    return _enlarged(found * step, step, known.shape)


def shifted(
    image: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"], shifts: Int[Tensor, "h w 2"]
) -> Float[Tensor, "h w 3"]:
    """At unknown pixels the known one that lies ``shifts`` (rows, columns) away; else zero."""
    rows, columns, valid = source_pixels(known, shifts)
    return torch.where((valid & ~known)[..., None], image[rows, columns], 0.0)


def _bounded(detail: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]) -> Float[Tensor, "h w 3"]:
    """No stronger than beside the hole, or it shows an object from elsewhere."""
    ring = grown(~known, math.ceil(DETAIL_SHARE * max(known.shape))) & known
    bound = LIMIT * detail[ring].square().mean().sqrt()
    return detail.clamp(-bound, bound)


def _enlarged(shifts: Int[Tensor, "hs ws 2"], step: int, shape: torch.Size) -> Int[Tensor, "h w 2"]:
    planes = shifts.movedim(-1, 0)[None].double()
    large = interpolate(planes, scale_factor=float(step), mode="nearest")[0].movedim(0, -1)
    return large[: shape[0], : shape[1]].long()


def means_within_objects(rgb: Float[Tensor, "h w 3"]) -> Float[Tensor, "h w 3"]:
    """Of the window around each pixel, without other objects: their colours would be detail.

    A joint bilateral filter (Petschnigg et al. 2004) whose guide is the blurred image.
    """
    return on_copy_of(rgb, _bilateral_means)


def _bilateral_means(rgb: Float[Tensor, "hs ws 3"]) -> Float[Tensor, "hs ws 3"]:
    # OpenCV takes a tenth of a second to load, which static small images need not wait for.
    import cv2

    half = math.ceil(DETAIL_SHARE * max(rgb.shape[:2]) / 2)
    image = rgb.detach().float().cpu().contiguous().numpy()
    guide = cv2.GaussianBlur(image, (0, 0), BLUR_PX)
    means = cv2.ximgproc.jointBilateralFilter(guide, image, 2 * half + 1, SHAPE_STEP, half)
    return torch.from_numpy(means).to(rgb)


def _window(hole: Bool[Tensor, "h w"]) -> tuple[slice, slice]:
    """Rows and columns of the hole and of what is around it."""
    spans = [hole.any(1).nonzero()[:, 0], hole.any(0).nonzero()[:, 0]]
    longer = max(int(span[-1] - span[0]) + 1 for span in spans)
    around = [math.ceil(share * longer) for share in CONTEXT]
    return tuple(
        slice(max(int(span[0]) - more, 0), int(span[-1]) + 1 + more)
        for span, more in zip(spans, around, strict=True)
    )
