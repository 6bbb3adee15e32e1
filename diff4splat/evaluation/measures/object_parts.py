"""Parts into which the motion of a scene tears an object, in its first image.

Axes: ``h w`` pixels, ``n`` pixels of one object. Neighbouring pixels belong to one part if their
displacements differ by at most ``MAX_STRETCH_PX``: what bends, or turns by up to 29 degrees, stays
whole. Parts with the displacement of the largest one count as that part, so an object that
something hides in the middle is not torn. What turns farther or grows is whole if its pixels hold
together beside the affine map that fits it best.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

MAX_STRETCH_PX = 0.5
"""Largest difference of displacement of two neighbouring pixels that hold together."""
TORN_SHARE = 0.9
"""An object is torn if its largest part has less of it."""


def is_torn(displacement_px: Float[Tensor, "h w 2"], mask: Bool[Tensor, "h w"]) -> bool:
    """Whether the object of ``mask`` falls into parts."""
    return largest_part_share(displacement_px, mask) < TORN_SHARE


def largest_part_share(displacement_px: Float[Tensor, "h w 2"], mask: Bool[Tensor, "h w"]) -> float:
    """Share of the object's pixels in its largest part; 1 for an empty mask."""
    if not bool(mask.any()):
        return 1.0
    share = _share_by_displacement(displacement_px, mask)
    if share >= TORN_SHARE:
        return share
    beside = torch.zeros_like(displacement_px)
    beside[mask] = _beside_affine(displacement_px, mask)
    linked = part_labels(beside, mask)[mask].unique(return_counts=True)[1]
    return max(share, int(linked.max()) / len(beside[mask]))


def _beside_affine(
    displacement_px: Float[Tensor, "h w 2"], mask: Bool[Tensor, "h w"]
) -> Float[Tensor, "n 2"]:
    """What the affine map that fits best leaves of the displacements."""
    row, column = mask.nonzero().double().unbind(-1)
    terms = torch.stack([row, column, torch.ones_like(row)], -1)
    found = displacement_px[mask].double()
    fit = torch.linalg.lstsq(terms, found, driver="gelsd").solution
    return (found - terms @ fit).to(displacement_px)


def _share_by_displacement(
    displacement_px: Float[Tensor, "h w 2"], mask: Bool[Tensor, "h w"]
) -> float:
    """Share of the largest part, with all parts that move as it does."""
    labels = part_labels(displacement_px, mask)[mask]
    names, sizes = labels.unique(return_counts=True)
    displacements = displacement_px[mask]
    typical = torch.stack([displacements[labels == name].median(0).values for name in names])
    same = (typical - typical[sizes.argmax()]).norm(dim=-1) <= MAX_STRETCH_PX
    return float(sizes[same].sum()) / len(labels)


def part_labels(
    displacement_px: Float[Tensor, "h w 2"], mask: Bool[Tensor, "h w"]
) -> Int[Tensor, "h w"]:
    """One number per part; equal exactly where pixels are linked through neighbours."""
    size = mask.numel()
    labels = torch.arange(size).view(mask.shape).where(mask, size)
    down = _linked(displacement_px[1:], displacement_px[:-1]) & mask[1:] & mask[:-1]
    right = _linked(displacement_px[:, 1:], displacement_px[:, :-1]) & mask[:, 1:] & mask[:, :-1]
    while True:
        before = labels.clone()
        for link, one, other in (
            (down, labels[1:], labels[:-1]),
            (right, labels[:, 1:], labels[:, :-1]),
        ):
            least = torch.minimum(one, other)
            one.copy_(torch.where(link, least, one))
            other.copy_(torch.where(link, torch.minimum(least, other), other))
        if torch.equal(before, labels):
            return labels


def eroded(mask: Bool[Tensor, "h w"]) -> Bool[Tensor, "h w"]:
    """Without the outermost pixels: a silhouette mixes the motion of both sides."""
    outside = (~mask).float()[None, None]
    near = torch.nn.functional.max_pool2d(outside, 3, stride=1, padding=1)[0, 0] > 0
    return mask & ~near


def _linked(one: Tensor, other: Tensor) -> Tensor:
    return (one - other).norm(dim=-1) <= MAX_STRETCH_PX
