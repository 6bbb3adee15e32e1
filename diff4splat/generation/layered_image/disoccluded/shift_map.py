"""From where to copy what fills a hole: one shift per pixel (Pritch et al. 2009, He and Sun 2012).

    ring around the hole ─ correlation with the image ─ the few shifts that fit it best
                                                   └─ per pixel, the one with the weakest seams

Axes: ``h w`` pixels, ``k`` shifts. Shifts are (rows, columns). Everything is a fixed sum, so equal
images have equal shifts; OpenCV's shift map does not keep that.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn.functional import avg_pool2d, max_pool2d

from diff4splat.generation.layered_image.disocclusion import grown

SHIFTS = 24
"""Candidates per hole; more change little."""
RING_PX = 6
"""Around the hole: pixels that a shift has to explain."""
LEAST_COVERAGE = 0.1
"""Of the hole: a shift that fills less is no candidate while others fill more."""
NOISE = 0.02
"""Of the colours: differences below it say nothing."""
SWEEPS = 6
"""Passes over the pixels; seams hardly move after them."""
FAR = 1e3
"""Cost where a shift ends outside of what is known."""
MEANS_WEIGHT = 10.0
"""Of the colours around the source against the guess, beside the seams."""
SPREAD_PX = 1
"""Half the window over which means are compared; a wide one lets a small other object pass."""
UNSEEN = 0.03
"""Squared difference from a neighbour where the shift ends outside: neither good nor bad."""


def shift_map(
    rgb: Float[Tensor, "h w 3"],
    even: Float[Tensor, "h w 3"],
    means: Float[Tensor, "h w 3"],
    known: Bool[Tensor, "h w"],
) -> Int[Tensor, "h w 2"]:
    """The shift of each unknown pixel to a known one; (0, 0) where it is known or none fits.

    ``even`` is a guess at the colours in the hole, which the ``means`` around the source should be.
    """
    shifts = candidate_shifts(rgb, known)
    if bool(known.all()) or not len(shifts):
        return shifts.new_zeros(*known.shape, 2)
    everywhere = shifts[:, None, None].expand(-1, *known.shape, -1)
    rows, columns, valid = source_pixels(known, everywhere)
    unlike = _spread((means[rows, columns] - even).square().sum(-1))
    cost = torch.where(valid, MEANS_WEIGHT * unlike, FAR)
    start = torch.where(known[..., None], rgb, even)
    label = _weakest_seams(start, known, rgb[rows, columns], cost)
    fits = valid.gather(0, label[None])[0] & ~known
    return torch.where(fits[..., None], shifts[label], 0)


def candidate_shifts(rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"]) -> Int[Tensor, "k 2"]:
    """The shifts under which the ring around the hole differs least from the image."""
    ring = grown(~known, RING_PX) & known
    # Rounded, so that equal shifts keep their order whatever the last bits of the transforms are.
    wrong, overlap, coverage = (each.float() for each in shift_errors(rgb, known, ring))
    usable = (overlap > 0.5) & (coverage > 1e-6)
    if bool((usable & (coverage >= LEAST_COVERAGE)).any()):
        usable &= coverage >= LEAST_COVERAGE
    score = torch.where(usable, -(wrong + NOISE**2) / coverage.clamp_min(1e-6), -torch.inf)
    peaks = score == max_pool2d(score[None], 3, 1, 1)[0]
    score = torch.where(peaks, score, -torch.inf)
    order = score.flatten().sort(descending=True, stable=True)
    found = order.indices[:SHIFTS][order.values[:SHIFTS] > -torch.inf]
    rows, columns = known.shape
    width = 2 * columns - 1
    return torch.stack([found // width - rows + 1, found % width - columns + 1], -1)


def shift_errors(
    rgb: Float[Tensor, "h w 3"], known: Bool[Tensor, "h w"], ring: Bool[Tensor, "h w"]
) -> tuple[Float[Tensor, "h2 w2"], Float[Tensor, "h2 w2"], Float[Tensor, "h2 w2"]]:
    """Per shift: the ring's mean squared error, its share that is known, and the hole's.

    Shifts run from minus to plus one less than the side: ``h2`` is 2 h - 1.
    """
    colors = torch.where(known[..., None], rgb, 0.0).double().movedim(-1, 0)
    some, at, hole = known.double(), ring.double(), (~known).double()
    count = _correlation(at, some)
    total = _correlation(at * (colors**2).sum(0), some) + _correlation(at, (colors**2).sum(0))
    total = total - 2 * sum(_correlation(at * channel, channel) for channel in colors)
    wrong = total.clamp_min(0) / count.clamp_min(1)
    coverage = _correlation(hole, some) / hole.sum().clamp_min(1)
    return wrong, count / at.sum().clamp_min(1), coverage


def _correlation(left: Float[Tensor, "h w"], right: Float[Tensor, "h w"]) -> Float[Tensor, "h2 w2"]:
    """Per shift s, the sum over x of left(x) right(x + s)."""
    size = [2 * side - 1 for side in left.shape]
    spectra = torch.fft.rfft2(left, s=size).conj() * torch.fft.rfft2(right, s=size)
    values = torch.fft.irfft2(spectra, s=size)
    return values.roll([side - 1 for side in left.shape], (0, 1))


def source_pixels(
    known: Bool[Tensor, "h w"], shifts: Int[Tensor, "*k h w 2"]
) -> tuple[Int[Tensor, "*k h w"], Int[Tensor, "*k h w"], Bool[Tensor, "*k h w"]]:
    """Row and column at the end of every shift, within the image, and whether it is known there."""
    height, width = known.shape
    rows = torch.arange(height, device=known.device)[:, None] + shifts[..., 0]
    columns = torch.arange(width, device=known.device) + shifts[..., 1]
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    rows, columns = rows.clamp(0, height - 1), columns.clamp(0, width - 1)
    return rows, columns, inside & known[rows, columns]


def _spread(cost: Float[Tensor, "k h w"]) -> Float[Tensor, "k h w"]:
    side = 2 * SPREAD_PX + 1
    return avg_pool2d(cost[None], side, 1, SPREAD_PX, count_include_pad=False)[0]


def _weakest_seams(
    rgb: Float[Tensor, "h w 3"],
    known: Bool[Tensor, "h w"],
    source: Float[Tensor, "k h w 3"],
    own_cost: Float[Tensor, "k h w"],
) -> Int[Tensor, "h w"]:
    """Labels by iterated conditional modes, on the two colours of a chequerboard by turns."""
    label = (own_cost >= FAR).float().argmin(0)  # the first that fits
    rows, columns = (torch.arange(side, device=rgb.device) for side in known.shape)
    even = (rows[:, None] + columns) % 2 == 0
    for sweep in range(2 * SWEEPS):
        chosen = source.gather(0, label[None, ..., None].expand(1, *rgb.shape))[0]
        filled = torch.where(known[..., None], rgb, chosen)
        unlike = (source - filled).square().sum(-1)
        seams = 9 * avg_pool2d(torch.where(own_cost < FAR, unlike, UNSEEN)[None], 3, 1, 1)[0]
        turn = even if sweep % 2 else ~even
        label = torch.where(turn & ~known, (own_cost + seams).argmin(0), label)
    return label
