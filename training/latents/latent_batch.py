"""Training samples of the video model: latents of true videos and of their render conditions.

Axes: ``b`` batch, ``c t h w`` latents, ``f`` video frames.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera, join_cameras


@dataclass(frozen=True, slots=True, kw_only=True)
class LatentBatch:
    """Encoded clips with their cameras and captions."""

    sample_index: Int[Tensor, " b"]
    source: tuple[str, ...]
    latent: Float[Tensor, "b c t h w"]
    render_condition: Float[Tensor, "b c t h w"] | None
    """None for a model without render conditions."""
    motion: Float[Tensor, "b m t h w"]
    """True motion (``video_motion``); no channels for a model that makes none."""
    cameras: Camera
    """Batch shape (b, f); the first of each sample is the identity."""
    captions: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.sample_index)

    def to(self, device: torch.device) -> "LatentBatch":
        """Move every tensor."""
        condition = self.render_condition
        return replace(
            self,
            sample_index=self.sample_index.to(device),
            latent=self.latent.to(device),
            render_condition=None if condition is None else condition.to(device),
            motion=self.motion.to(device),
            cameras=self.cameras.to(device),
        )


def collate_latents(samples: list[LatentBatch]) -> LatentBatch:
    """Batches of one sample each, as one."""
    conditions = [
        sample.render_condition for sample in samples if sample.render_condition is not None
    ]
    return LatentBatch(
        sample_index=torch.cat([sample.sample_index for sample in samples]),
        source=tuple(name for sample in samples for name in sample.source),
        latent=torch.cat([sample.latent for sample in samples]),
        render_condition=torch.cat(conditions) if conditions else None,
        motion=torch.cat([sample.motion for sample in samples]),
        cameras=join_cameras([sample.cameras for sample in samples]),
        captions=tuple(text for sample in samples for text in sample.captions),
    )
