"""Left and right exchanged in some samples, captions included.

Captions alone then decide which side is left.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch

from diff4splat.captions.mirror import mirrored_caption
from diff4splat.training.batches.clip_batch import ClipBatch


def flip_samples(batch: ClipBatch, flipped: Sequence[bool]) -> ClipBatch:
    """Images, motion and captions of the named samples mirrored; targets stay as they are."""
    flip = torch.tensor(flipped, device=batch.field.device)
    sign = batch.field.new_tensor([-1.0, 1.0, 1.0])[:, None, None, None]
    moving = torch.where(flip[:, None, None], batch.moving.flip(-1), batch.moving)
    flip = flip[:, None, None, None, None]
    field = torch.where(flip, batch.field.flip(-1) * sign, batch.field)
    video = torch.where(flip, batch.video.flip(-2), batch.video)
    captions = tuple(
        mirrored_caption(caption) if mirror else caption
        for caption, mirror in zip(batch.captions, flipped, strict=True)
    )
    return replace(batch, video=video, field=field, moving=moving, captions=captions)
