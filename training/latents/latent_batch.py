"""Training samples of the video model: latents of true videos and of their render conditions.

Axes: ``b`` batch, ``c t h w`` latents, ``f hh ww`` video frames and pixels.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.geometry.camera import Camera, join_cameras
from diff4splat.models.video_dit.conditions import RenderCondition


@dataclass(frozen=True, slots=True, kw_only=True)
class LatentBatch:
    """Encoded clips with their cameras and captions."""

    sample_index: Int[Tensor, " b"]
    source: tuple[str, ...]
    latent: Float[Tensor, "b c t h w"]
    render_latent: Float[Tensor, "b c t h w"] | None
    """Of the render condition; None for a model without."""
    validity: Float[Tensor, "b 1 f hh ww"] | None
    """1 where the first frame shows what a pixel sees; None without a render condition."""
    cameras: Camera
    """Batch shape (b, f); the first of each sample is the identity."""
    captions: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.sample_index)

    @property
    def render_condition(self) -> RenderCondition | None:
        """As the video model takes it."""
        if self.render_latent is None:
            return None
        return RenderCondition(latent=self.render_latent, validity=self.validity)

    def to(self, device: torch.device) -> "LatentBatch":
        """Move every tensor."""
        render, validity = self.render_latent, self.validity
        return replace(
            self,
            sample_index=self.sample_index.to(device),
            latent=self.latent.to(device),
            render_latent=None if render is None else render.to(device),
            validity=None if validity is None else validity.to(device),
            cameras=self.cameras.to(device),
        )


def collate_latents(samples: list[LatentBatch]) -> LatentBatch:
    """Batches of one sample each, as one."""
    rendered = [sample for sample in samples if sample.render_latent is not None]
    return LatentBatch(
        sample_index=torch.cat([sample.sample_index for sample in samples]),
        source=tuple(name for sample in samples for name in sample.source),
        latent=torch.cat([sample.latent for sample in samples]),
        render_latent=torch.cat([one.render_latent for one in rendered]) if rendered else None,
        validity=torch.cat([one.validity for one in rendered]) if rendered else None,
        cameras=join_cameras([sample.cameras for sample in samples]),
        captions=tuple(text for sample in samples for text in sample.captions),
    )
