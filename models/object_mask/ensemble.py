"""Object masks that see through different backbones, as one network (ADR 58).

Axes: ``b`` images, ``r`` prompts of an image, ``h w`` pixels, ``c`` channels. Each member reads
the prompt with queries of its own; logits are averaged (deep ensembles, arXiv 1612.01474).
Spaces of instance vectors cannot be averaged, so those of the last member count.
"""

from collections.abc import Sequence
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.motion_unet.text_tokens import TextTokens, text_tokens
from diff4splat.models.object_mask.backbone_network import BackboneObjectMaskNet
from diff4splat.models.object_mask.mask_heads import HeadShape


class ObjectMaskEnsemble(nn.Module):
    """The calls of one object mask, answered by all members."""

    def __init__(self, shape: HeadShape, sizes: Sequence[BackboneSize]) -> None:
        """One member for every one of ``sizes``; the last has the instance vectors."""
        super().__init__()
        shapes = [replace(shape, instance_channels=0)] * (len(sizes) - 1) + [shape]
        pairs = zip(shapes, sizes, strict=True)
        self.members = nn.ModuleList([BackboneObjectMaskNet(*pair) for pair in pairs])
        self.has_instances = shape.instance_channels > 0

    def features(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b c h2 w2"]:
        """Of every member, one after the other."""
        return torch.cat([member.features(image) for member in self.members], 1)

    def forward(
        self,
        image: Float[Tensor, "b 3 h w"],
        text: Float[Tensor, "b s e"],
        text_mask: Bool[Tensor, "b s"] | None = None,
    ) -> Float[Tensor, "b h w"]:
        """As ``MaskHeads.forward``."""
        return self.logits(self.features(image), text_tokens(text, text_mask))[:, 0]

    def predict_mask_and_instances(
        self,
        image: Float[Tensor, "b 3 h w"],
        text: Float[Tensor, "b s e"],
        text_mask: Bool[Tensor, "b s"] | None = None,
    ) -> tuple[Float[Tensor, "b h w"], Float[Tensor, "b k h w"] | None]:
        """As ``MaskHeads.predict_mask_and_instances``."""
        features = self.features(image)
        logits = self.logits(features, text_tokens(text, text_mask))[:, 0]
        return logits, self.instances(features) if self.has_instances else None

    def logits(
        self, features: Float[Tensor, "b c h2 w2"], text: TextTokens
    ) -> Float[Tensor, "b r h w"]:
        """Means over the members."""
        return self._mean([mask.logits(part, text) for mask, part in self._parts(features)])

    def name_logits(
        self, features: Float[Tensor, "b c h2 w2"]
    ) -> tuple[Float[Tensor, "b n h2 w2"], Float[Tensor, "b k h2 w2"]]:
        """Means over the members."""
        pairs = [mask.name_logits(part) for mask, part in self._parts(features)]
        nouns, colors = zip(*pairs, strict=True)
        return self._mean(nouns), self._mean(colors)

    def instances(self, features: Float[Tensor, "b c h2 w2"]) -> Float[Tensor, "b k h w"]:
        """Vectors and log scale of every pixel."""
        mask, part = self._parts(features)[-1]
        return mask.instances(part)

    def _parts(self, features: Tensor) -> list[tuple[BackboneObjectMaskNet, Tensor]]:
        """Every member, and its own features."""
        parts = features.chunk(len(self.members), 1)
        return list(zip(self.members, parts, strict=True))

    def _mean(self, values: Sequence[Tensor]) -> Tensor:
        return sum(values[1:], values[0]) / len(self.members)
