"""Images with many prompts each.

Axes: ``b`` images, ``r`` prompts of an image, ``h w`` pixels.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestBatch:
    """Images, prompts, and the pixels that each prompt asks to move."""

    sample_index: Int[Tensor, " b"]
    source: tuple[str, ...]
    images: UInt8[Tensor, "b h w 3"]
    masks: Bool[Tensor, "b r h w"]
    nouns: UInt8[Tensor, "b h w"]
    """1 + index in ``vocabulary.NOUNS`` of what a pixel shows; 0 for none, or ``UNKNOWN_NAME``."""
    colors: UInt8[Tensor, "b h w"]
    """1 + index in ``colors.COLOR_NAMES``."""
    objects: UInt8[Tensor, "b h w"]
    """Number of the object that a pixel shows, whatever its name; 0 for all else."""
    has_requests: Bool[Tensor, " b"]
    """Whether the prompts of an image count: those of some sources do not."""
    captions: tuple[str, ...]
    """b r of them; those of one image follow each other."""

    def __len__(self) -> int:
        return len(self.sample_index)

    def to(self, device: torch.device) -> "RequestBatch":
        """Move every tensor."""
        return replace(
            self,
            sample_index=self.sample_index.to(device),
            images=self.images.to(device),
            masks=self.masks.to(device),
            nouns=self.nouns.to(device),
            colors=self.colors.to(device),
            objects=self.objects.to(device),
            has_requests=self.has_requests.to(device),
        )


def collate_requests(samples: list[RequestBatch]) -> RequestBatch:
    """Batches of one image each, as one."""
    return RequestBatch(
        sample_index=torch.cat([sample.sample_index for sample in samples]),
        source=tuple(name for sample in samples for name in sample.source),
        images=torch.cat([sample.images for sample in samples]),
        masks=torch.cat([sample.masks for sample in samples]),
        nouns=torch.cat([sample.nouns for sample in samples]),
        colors=torch.cat([sample.colors for sample in samples]),
        objects=torch.cat([sample.objects for sample in samples]),
        has_requests=torch.cat([sample.has_requests for sample in samples]),
        captions=tuple(text for sample in samples for text in sample.captions),
    )
