"""Images, the same images without one object, and the object's mask.

Axes: ``b`` images, ``h w`` pixels.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Int, UInt8
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowBatch:
    """What an object shadow learns from."""

    sample_index: Int[Tensor, " b"]
    source: tuple[str, ...]
    images: UInt8[Tensor, "b h w 3"]
    without: UInt8[Tensor, "b h w 3"]
    masks: Bool[Tensor, "b h w"]

    def __len__(self) -> int:
        return len(self.sample_index)

    def to(self, device: torch.device) -> "ShadowBatch":
        """Move every tensor."""
        return replace(
            self,
            sample_index=self.sample_index.to(device),
            images=self.images.to(device),
            without=self.without.to(device),
            masks=self.masks.to(device),
        )


def collate_shadows(samples: list[ShadowBatch]) -> ShadowBatch:
    """Batches of one image each, as one."""
    return ShadowBatch(
        sample_index=torch.cat([sample.sample_index for sample in samples]),
        source=tuple(name for sample in samples for name in sample.source),
        images=torch.cat([sample.images for sample in samples]),
        without=torch.cat([sample.without for sample in samples]),
        masks=torch.cat([sample.masks for sample in samples]),
    )
