"""Which pixels of a judged picture the input shows: what part of an error is not a guess.

Axes: ``p`` judged pictures, ``h w`` pixels. The surface behind a pixel, placed by its true depth,
is seen when in an input frame it lies before the camera, inside the picture, and within
``AGREEMENT`` of the true depth there. Sky has no depth and is never seen.

Surfaces that stand are looked for in all input frames. Of what moves, only the place at the judged
time is known, so it is looked for there, in the input frame before and in the one after. What moves
farther in between than it is large counts as hidden.

The mask serves as in Gao et al., Monocular Dynamic View Synthesis: A Reality Check, NeurIPS 2022
(arXiv 2210.13445). They have no true depth: theirs comes from optical flow there and back, and asks
for more than five input frames, and a tenth of all, that show the pixel. Here one is enough.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, View
from diff4splat.evaluation.protocol import Pair
from diff4splat.evaluation.sample import Case
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.normalise_scale import valid_depth

AGREEMENT = 0.05
"""Largest difference of two depths of one surface, as a share of the depth in the input frame."""
STILL = 1e-3 * PLANE_DEPTH
"""Points of an instance that stands never go farther, in model units: a thousandth of the median
depth of the first frame."""
INSTANCES = 256
UNKNOWN = 0
"""The instance of sky, and of what has none."""


def covisible(case: Case) -> Bool[Tensor, "p h w"] | None:
    """The pixels of every judged picture that the input shows; None for clips without depth."""
    if not case.has_depth:
        return None
    still = still_instances(case.clip)
    return torch.stack([_covisible_picture(case, pair, still) for pair in case.judged.pairs])


def still_instances(clip: Clip) -> Bool[Tensor, " 256"]:
    """Which instance numbers stand for sure: those with tracked points, none of which moves."""
    still = torch.zeros(INSTANCES, dtype=torch.bool)
    if clip.tracks is None:
        return still
    positions, instances = clip.tracks.positions.double(), clip.tracks.instances.long()
    away = (positions - positions[:1]).norm(dim=-1)
    # Written so that NaN counts as moving.
    moves = ~(away <= STILL).all(0)
    still[instances] = True
    still[instances[moves]] = False
    still[UNKNOWN] = False
    return still


def _covisible_picture(case: Case, pair: Pair, still: Bool[Tensor, " 256"]) -> Bool[Tensor, "h w"]:
    depth = case.true_depth(pair).double()
    known = valid_depth(depth)
    points = unproject(case.camera(pair).to(torch.float64), depth)
    stands = _standing(case.clip.views[pair[0]], pair[1], still)
    around = case.input_around(pair[1])
    seen = torch.zeros_like(known)
    for frame in case.input_frames:
        shown = _shows(case.input_view, frame, points)
        seen |= shown if frame in around else shown & stands
    # A pixel without depth has no point; what was found for it means nothing.
    return seen & known


def _standing(view: View, frame: int, still: Bool[Tensor, " 256"]) -> Bool[Tensor, "h w"]:
    """Pixels of instances that stand; none if it is not known what they show."""
    if view.instances is None:
        return torch.zeros(view.cameras.size_px, dtype=torch.bool)
    return still[view.instances[frame].long()]


def _shows(view: View, frame: int, points: Float[Tensor, "h w 3"]) -> Bool[Tensor, "h w"]:
    """Which world points a frame shows: before the camera, inside, and where depth says so."""
    height, width = view.cameras.size_px
    flat = project(view.cameras[frame].to(torch.float64), points.flatten(0, 1))
    pixels, z = (part.unflatten(0, (height, width)) for part in flat)
    columns, rows = pixels.floor().unbind(-1)
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    # Elsewhere any pixel will do: it is not looked at.
    places = [torch.where(inside, place, 0.0).long() for place in (rows, columns)]
    depth = view.depth[frame].double()[places[0], places[1]]
    # Behind the camera z is negative and agrees with no depth.
    return inside & valid_depth(depth) & ((z - depth).abs() <= AGREEMENT * depth)
