"""Which pixels show what stands still in the world, as far as a clip says."""

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip, View

_STILL = 1e-6
"""Largest movement of a track, relative to its distance from the first camera plus one."""


def static_pixels(clip: Clip, view: View) -> Bool[Tensor, "t h w"] | None:
    """True where nothing moves but the camera; None when the clip does not tell."""
    if clip.note.is_static:
        return torch.ones(view.depth.shape, dtype=torch.bool)
    still = static_instances(clip)
    if view.instances is None or not still:
        return None
    return torch.isin(view.instances.long(), torch.tensor(sorted(still)))


def static_instances(clip: Clip) -> frozenset[int]:
    """Objects noted without motion, and unnoted ones of which no track ever moves."""
    noted = {each.instance for each in clip.note.objects}
    still = {each.instance for each in clip.note.objects if not each.motion}
    if clip.tracks is not None and len(clip.tracks.instances):
        positions = clip.tracks.positions.double()
        moved = (positions - positions[:1]).norm(dim=-1).amax(0)
        moves = moved > _STILL * (1 + positions[0].norm(dim=-1))
        every = set(clip.tracks.instances.tolist())
        moving = set(clip.tracks.instances[moves].tolist())
        still |= every - moving - noted
    return frozenset(still - {0})
