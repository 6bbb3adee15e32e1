"""Where the surface of a target image was at another time, by the true tracks of its object.

Axes: ``n`` points, ``k`` tracked points of one object. The rigid motion that fits the object's
tracks best (Kabsch 1976), plus what is left of it at the nearest tracked point: exact for rigid
objects, and close for those that bend.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View

INSTANCE_COUNT = 256
LEAST_POINTS = 3
"""Fewer points determine no rotation: then the object is only displaced."""


def moving_pixels(clip: Clip, view: View, frame: int) -> Bool[Tensor, "h w"]:
    """Pixels of what moves in the clip: by the view's own mask, else by its tracked instances."""
    if view.moving is not None:
        return view.moving[frame]
    if view.instances is None:
        return torch.zeros(view.cameras.size_px, dtype=torch.bool)
    return moving_instances(clip)[view.instances[frame].long()]


def moving_instances(clip: Clip, least: float = 4e-3) -> Bool[Tensor, " 256"]:
    """Instances with a tracked point that moves farther than ``least``, in units of the clip."""
    moves = torch.zeros(INSTANCE_COUNT, dtype=torch.bool)
    if clip.tracks is not None and clip.tracks.instances is not None:
        positions = clip.tracks.positions.double()
        is_far = ((positions - positions[:1]).norm(dim=-1) > least).any(0)
        moves[clip.tracks.instances[is_far].long()] = True
    moves[0] = False
    return moves


def points_at(
    clip: Clip,
    points: Float[Tensor, "n 3"],
    instances: Int[Tensor, " n"],
    frames: tuple[int, int],
) -> Float[Tensor, "n 3"]:
    """Surface points of the first of ``frames`` at the time of the second.

    Points of instances without tracks stay where they are.
    """
    moved = points.double().clone()
    if clip.tracks is None or clip.tracks.instances is None or frames[0] == frames[1]:
        return moved
    for instance in instances.unique().tolist():
        known = _known(clip.tracks, instance, frames)
        if instance and bool(known.any()):
            pair = [clip.tracks.positions[frame, known].double() for frame in frames]
            mine = instances == instance
            moved[mine] = _carried(moved[mine], pair[0], pair[1])
    return moved


def _known(tracks: Tracks, instance: int, frames: tuple[int, int]) -> Bool[Tensor, " n"]:
    of_instance = tracks.instances.long() == instance
    if tracks.known is None:
        return of_instance
    return of_instance & tracks.known[frames[0]] & tracks.known[frames[1]]


def _carried(
    points: Float[Tensor, "n 3"], before: Float[Tensor, "k 3"], after: Float[Tensor, "k 3"]
) -> Float[Tensor, "n 3"]:
    rotation = _rotation(before, after)
    centers = before.mean(0), after.mean(0)
    rest = after - ((before - centers[0]) @ rotation.mT + centers[1])
    nearest = torch.cdist(points, before).argmin(-1)
    return (points - centers[0]) @ rotation.mT + centers[1] + rest[nearest]


def _rotation(before: Float[Tensor, "k 3"], after: Float[Tensor, "k 3"]) -> Float[Tensor, "3 3"]:
    """The rotation that turns ``before`` onto ``after`` around their means; no reflection."""
    if len(before) < LEAST_POINTS:
        return torch.eye(3, dtype=before.dtype)
    u, _, vh = torch.linalg.svd((after - after.mean(0)).mT @ (before - before.mean(0)))
    sign = torch.ones(3, dtype=before.dtype)
    sign[2] = torch.sign(torch.linalg.det(u @ vh))
    return u @ torch.diag(sign) @ vh
