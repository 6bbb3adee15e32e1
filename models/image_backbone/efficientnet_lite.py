"""EfficientNet-Lite without its classifier: features of an image at five resolutions.

Axes: ``n`` images, ``h w`` pixels, ``c`` channels. Layout of the TensorFlow release of 2020: no
squeeze-and-excitation, ReLU6 throughout. Channels of Lite0:

    image ─ stem 1/2 ─ 16 @ 1/2 ─ 24 @ 1/4 ─ 40 @ 1/8 ─ 80, 112 @ 1/16 ─ 192, 320 @ 1/32
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from diff4splat.models.config.priors import BackboneSize
from diff4splat.models.image_backbone.inverted_residual import (
    BlockShape,
    InvertedResidual,
    SameConv2d,
)

STEM_CHANNELS = 32
STAGES = {
    # blocks, kernel, stride, expansion, channels
    "lite0": (
        (1, 3, 1, 1, 16),
        (2, 3, 2, 6, 24),
        (2, 5, 2, 6, 40),
        (3, 3, 2, 6, 80),
        (3, 5, 1, 6, 112),
        (4, 5, 2, 6, 192),
        (1, 3, 1, 6, 320),
    ),
    "lite2": (
        (1, 3, 1, 1, 16),
        (3, 3, 2, 6, 24),
        (3, 5, 2, 6, 48),
        (4, 3, 2, 6, 88),
        (4, 5, 1, 6, 120),
        (5, 5, 2, 6, 208),
        (1, 3, 1, 6, 352),
    ),
}
FEATURE_STAGES = (0, 1, 2, 4, 6)
"""Stages after which a resolution is complete."""
FEATURE_CHANNELS = {
    size: tuple(stages[stage][-1] for stage in FEATURE_STAGES) for size, stages in STAGES.items()
}
"""Of every size, channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the resolution."""
MEAN, DEVIATION = 127 / 255, 128 / 255
"""Of the colours, as the public weights were trained."""


class EfficientNetLite(nn.Module):
    """Features of every resolution, finest first."""

    def __init__(self, levels: int = len(FEATURE_STAGES), size: BackboneSize = "lite0") -> None:
        """``levels`` resolutions; the layers after them, most of the weights, are left out."""
        super().__init__()
        self.size = size
        self.stem = SameConv2d(3, STEM_CHANNELS, 3, 2, groups=1)
        channels, self.stages = STEM_CHANNELS, nn.ModuleList()
        last = FEATURE_STAGES[levels - 1]
        for blocks, kernel, stride, expansion, wide in STAGES[size][: last + 1]:
            shapes = [
                BlockShape(wide if i else channels, wide, kernel, 1 if i else stride, expansion)
                for i in range(blocks)
            ]
            self.stages.append(nn.Sequential(*(InvertedResidual(shape) for shape in shapes)))
            channels = wide

    def forward(self, image: Float[Tensor, "n 3 h w"]) -> list[Float[Tensor, "n c hl wl"]]:
        """``image`` is RGB in [0, 1], its sides multiples of two to the number of levels."""
        features = torch.nn.functional.relu6(self.stem((image - MEAN) / DEVIATION))
        levels = []
        for index, stage in enumerate(self.stages):
            features = stage(features)
            if index in FEATURE_STAGES:
                levels.append(features)
        return levels
