"""What hides a pixel of a target image from the input, by the true depth, masks and cameras.

Axes: ``p`` target images, ``h w`` pixels. The surface of a pixel that is not covisible is carried
back to the time of an input frame with its object. It was

    shown          visible there after all: its object has moved since. Then the pixel is not hidden
    outside        out of the frame of every input image, or behind its camera
    disoccluded    inside, and behind what is static: it is in view because the camera has moved
    disoccluded_by_motion    inside, and behind something that moves, itself included

Nothing of it depends on a prediction: a system cannot choose which pixels it is judged by.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.evaluation.measures.covisibility import visible_in
from diff4splat.evaluation.measures.moved_points import moving_pixels, points_at
from diff4splat.evaluation.protocols.protocol import Pair
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.training.batches.normalise_scale import valid_depth

CLASSES = ("disoccluded", "disoccluded_by_motion", "outside")


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenPixels:
    """Pixels of the target images that the input hides, each in one class."""

    disoccluded: Bool[Tensor, "p h w"]
    disoccluded_by_motion: Bool[Tensor, "p h w"]
    outside: Bool[Tensor, "p h w"]

    @property
    def regions(self) -> dict[str, Bool[Tensor, "p h w"]]:
        """The three classes, and before them their union ``hidden``."""
        classes = {name: getattr(self, name) for name in CLASSES}
        return {"hidden": self.disoccluded | self.disoccluded_by_motion | self.outside, **classes}


def hidden_pixels(sample: EvalSample, covisible: Bool[Tensor, "p h w"]) -> HiddenPixels:
    """Classes of all target images of a clip with depth; sky is in none."""
    pairs = zip(sample.targets.pairs, covisible, strict=True)
    masks = [_classes(sample, pair, seen) for pair, seen in pairs]
    return HiddenPixels(**{name: torch.stack([mask[name] for mask in masks]) for name in CLASSES})


def _classes(
    sample: EvalSample, pair: Pair, covisible: Bool[Tensor, "h w"]
) -> dict[str, Bool[Tensor, "h w"]]:
    depth = sample.true_depth(pair).double()
    unseen = valid_depth(depth) & ~covisible
    shown, inside, disoccluded_by_motion = (torch.zeros_like(unseen) for _ in range(3))
    for frame in sample.input_frames:
        points = _carried(sample, pair, frame, depth)
        covers = _inside(sample, frame, points)
        shown |= visible_in(sample.input_view, frame, points)
        inside |= covers.any_pixel
        disoccluded_by_motion |= covers.moving
    hidden = unseen & ~shown
    return {
        "disoccluded": hidden & inside & ~disoccluded_by_motion,
        "disoccluded_by_motion": hidden & disoccluded_by_motion,
        "outside": hidden & ~inside,
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Covers:
    """Where surface points fall into an input image."""

    any_pixel: Bool[Tensor, "h w"]
    moving: Bool[Tensor, "h w"]
    """On a pixel of a moving object in front of them."""


def _inside(sample: EvalSample, frame: int, points: Float[Tensor, "h w 3"]) -> _Covers:
    view = sample.input_view
    height, width = view.cameras.size_px
    flat = project(view.cameras[frame].to(torch.float64), points.flatten(0, 1))
    pixels, z = (part.unflatten(0, points.shape[:2]) for part in flat)
    columns, rows = pixels.floor().unbind(-1)
    inside = (z > 0) & (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    rows, columns = (torch.where(inside, index, 0.0).long() for index in (rows, columns))
    depth = view.depth[frame].double()[rows, columns]
    moving = moving_pixels(sample.clip, view, frame)[rows, columns]
    return _Covers(any_pixel=inside, moving=inside & moving & (depth < z))


def _carried(
    sample: EvalSample, pair: Pair, frame: int, depth: Float[Tensor, "h w"]
) -> Float[Tensor, "h w 3"]:
    """Surface points of a target image at the time of an input frame."""
    points = unproject(sample.camera(pair).to(torch.float64), depth)
    view = sample.clip.views[pair[0]]
    if view.instances is None:
        return points
    moving = moving_pixels(sample.clip, view, pair[1])
    carried = points.clone()
    instances = view.instances[pair[1]].long()[moving]
    carried[moving] = points_at(sample.clip, points[moving], instances, (pair[1], frame))
    return carried
