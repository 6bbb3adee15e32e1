"""The object mask that the motion network is shown in training: of one object, never exact.

Axes: ``b`` samples, ``t`` latent frames, ``h w`` pixels, ``hc wc`` cells.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.generation.layered_image.disocclusion import grown
from diff4splat.generation.layered_image.rigid_components import connected_components
from diff4splat.models.config.networks import MOTION_CELL_PX
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.batches.motion_targets import extended_from

ABSENT_SHARE = 0.15
"""Of the samples without a mask: a network that is shown none predicts as well as before."""
LEAST_PX = 24
"""Of a component; smaller ones are fragments of what is hidden."""
LARGEST_ERROR_PX = 3
"""By which the edge of a mask is off."""
CUT_SHARE = 0.2
"""Of the masks that lack one side."""


def with_object_masks(
    batch: ClipBatch, generators: Sequence[torch.Generator]
) -> tuple[ClipBatch, Float[Tensor, "b h w"]]:
    """One object of every sample, and its mask; 0 where the network is to do without one.

    A sample whose mask is shown has the motion of that object alone.
    """
    fields, moving, masks = [], [], []
    for number, generator in enumerate(generators):
        own, motion = batch.moving[number], batch.field[number]
        mask = torch.zeros_like(own)
        if float(torch.rand((), generator=generator)) >= ABSENT_SHARE:
            own = mask = draw_component(own, generator)
            motion = motion_of_object(motion, own)
        fields.append(motion)
        moving.append(own)
        masks.append(inexact(mask, generator).to(motion))
    batch = replace(batch, field=torch.stack(fields), moving=torch.stack(moving))
    return batch, torch.stack(masks)


def draw_component(moving: Bool[Tensor, "h w"], generator: torch.Generator) -> Bool[Tensor, "h w"]:
    """One of the connected components, whatever its size; all where none is large enough."""
    labels = connected_components(moving)
    sizes = torch.bincount(labels.flatten())[1:]
    large = (sizes >= LEAST_PX).nonzero()[:, 0]
    if len(large) == 0:
        return moving
    return labels == 1 + large[int(torch.randint(len(large), (), generator=generator))]


def motion_of_object(
    field: Float[Tensor, "3 t hc wc"], mask: Bool[Tensor, "h w"]
) -> Float[Tensor, "3 t hc wc"]:
    """The motion in the cells of ``mask``, extended to all others."""
    share = torch.nn.functional.avg_pool2d(mask.to(field)[None], MOTION_CELL_PX)[0]
    return extended_from(field, share > 0)


def inexact(mask: Bool[Tensor, "h w"], generator: torch.Generator) -> Bool[Tensor, "h w"]:
    """About the same mask, as an object mask finds it: larger or smaller, or without one side."""
    error = int(torch.randint(-LARGEST_ERROR_PX, LARGEST_ERROR_PX + 1, (), generator=generator))
    found = grown(mask, error) if error >= 0 else ~grown(~mask, -error)
    if float(torch.rand((), generator=generator)) < CUT_SHARE:
        found = _cut(found, generator)
    return found if found.any() else mask


def _cut(mask: Bool[Tensor, "h w"], generator: torch.Generator) -> Bool[Tensor, "h w"]:
    """What lies on one side of a line through one of its pixels."""
    pixels = mask.nonzero()
    if len(pixels) == 0:
        return mask
    through = pixels[int(torch.randint(len(pixels), (), generator=generator))]
    normal = torch.randn(2, generator=generator).to(mask.device)
    kept = ((pixels - through).float() @ normal) >= 0
    cut = torch.zeros_like(mask)
    cut[pixels[kept, 0], pixels[kept, 1]] = True
    return cut
