"""The block of MobileNetV2 and EfficientNet-Lite (arXiv 1801.04381, figure 3d).

Axes: ``n`` images, ``c`` channels, ``h w`` cells. Batch norms are part of the convolutions: a
small batch of drawn images would spoil the statistics of photographs.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn


@dataclass(frozen=True, slots=True)
class BlockShape:
    """Shape of a block."""

    channels_in: int
    channels_out: int
    kernel: int
    stride: int
    expansion: int


class SameConv2d(nn.Conv2d):
    """Convolution whose output is input / stride cells; an odd padding cell goes right and below.

    So the public weights were trained (TensorFlow's SAME for even sides).
    """

    def __init__(self, channels_in: int, channels_out: int, kernel: int, stride: int, groups: int):
        super().__init__(channels_in, channels_out, kernel, stride, groups=groups)
        before = (kernel - stride) // 2
        after = kernel - stride - before
        self.margins = (before, after, before, after)

    def forward(self, features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h2 w2"]:
        """Sides must be multiples of the stride."""
        padded = torch.nn.functional.pad(features, self.margins)
        if self.groups == 1:
            return super().forward(padded)
        # The gradient of a depthwise convolution in bfloat16 takes processors three times as long.
        with torch.autocast(features.device.type, enabled=False):
            return super().forward(padded.to(self.weight.dtype))


class InvertedResidual(nn.Module):
    """1 × 1 to more channels, depthwise, 1 × 1 back; the input is added where shapes agree."""

    def __init__(self, shape: BlockShape) -> None:
        super().__init__()
        wide = shape.channels_in * shape.expansion
        expands = shape.expansion > 1
        self.expand = nn.Conv2d(shape.channels_in, wide, 1) if expands else None
        self.depthwise = SameConv2d(wide, wide, shape.kernel, shape.stride, groups=wide)
        self.project = nn.Conv2d(wide, shape.channels_out, 1)
        self.residual = shape.stride == 1 and shape.channels_in == shape.channels_out

    def forward(self, features: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c2 h2 w2"]:
        """Sides must be multiples of the stride."""
        hidden = features
        if self.expand is not None:
            hidden = torch.nn.functional.relu6(self.expand(hidden))
        hidden = self.project(torch.nn.functional.relu6(self.depthwise(hidden)))
        return features + hidden if self.residual else hidden
