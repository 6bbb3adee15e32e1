"""Pixels of static surfaces, as far as a clip determines them."""

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip, View

_STILL = 1e-6
"""Largest displacement of a static track, relative to its distance from the first camera + 1."""


def static_pixels(clip: Clip, view: View) -> Bool[Tensor, "t h w"] | None:
    """Mask of static pixels; None if the clip has no instances or no static ones."""
    if clip.note.is_static:
        return torch.ones(view.depth.shape, dtype=torch.bool)
    static = static_instances(clip)
    if view.instances is None or not static:
        return None
    return torch.isin(view.instances.long(), torch.tensor(sorted(static)))


def static_instances(clip: Clip) -> frozenset[int]:
    """Objects with a note without motion, and objects without a note whose tracks are static."""
    noted = {each.instance for each in clip.note.objects}
    static = {each.instance for each in clip.note.objects if not each.motion}
    if clip.tracks is not None and len(clip.tracks.instances):
        positions = clip.tracks.positions.double()
        displacement = (positions - positions[:1]).norm(dim=-1).amax(0)
        moves = displacement > _STILL * (1 + positions[0].norm(dim=-1))
        every = set(clip.tracks.instances.tolist())
        moving = set(clip.tracks.instances[moves].tolist())
        static |= every - moving - noted
    return frozenset(static - {0})
