"""Pixels of static surfaces, as far as a clip determines them."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.data.clip import Clip, Tracks, View

_STILL = 1e-6
"""Largest displacement of a static track, relative to its distance from the first camera + 1."""


def static_pixels(clip: Clip, view: View) -> Bool[Tensor, "t h w"] | None:
    """Mask of static pixels; None if neither a mask nor instances tell them."""
    if clip.note.is_static:
        return torch.ones(view.rgb.shape[:-1], dtype=torch.bool)
    if view.moving is not None:
        return ~view.moving
    static = static_instances(clip)
    if view.instances is None or not static:
        return None
    return torch.isin(view.instances.long(), torch.tensor(sorted(static)))


def static_instances(clip: Clip) -> frozenset[int]:
    """Objects with a note without motion, and objects without a note whose tracks are static."""
    noted = {each.instance for each in clip.note.objects}
    static = {each.instance for each in clip.note.objects if not each.motion}
    if clip.tracks is not None and clip.tracks.instances is not None:
        positions = _known_positions(clip.tracks)
        displacement = (positions - positions[:1]).norm(dim=-1).amax(0)
        moves = displacement > _STILL * (1 + positions[0].norm(dim=-1))
        every = set(clip.tracks.instances.tolist())
        moving = set(clip.tracks.instances[moves].tolist())
        static |= every - moving - noted
    return frozenset(static - {0})


def _known_positions(tracks: Tracks) -> Float[Tensor, "t n 3"]:
    """Positions, those of unknown frames replaced by the first known one: they move nothing."""
    positions = tracks.positions.double()
    if tracks.known is None:
        return positions
    first = tracks.known.int().argmax(0)
    start = positions[first, torch.arange(positions.shape[1])]
    return torch.where(tracks.known[..., None], positions, start)
