"""The backbones of LPIPS: VGG16 and AlexNet, up to their last ReLU.

Layers are numbered as in torchvision's ``features``: convolution ``i`` is followed by its ReLU
``i + 1``. LPIPS (https://github.com/richzhang/PerceptualSimilarity, ``pretrained_networks.py``)
splits them into five slices, keeps those numbers in its weight names (``net.slice2.5.weight``), and
uses the output of every slice.
"""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Convolution:
    """Convolution with bias, followed by a ReLU."""

    index: int
    inputs: int
    outputs: int
    kernel: int = 3
    stride: int = 1
    padding: int = 1


@dataclass(frozen=True, slots=True)
class MaxPool:
    """Max pooling."""

    kernel: int
    stride: int = 2


@dataclass(frozen=True, slots=True)
class Backbone:
    """A network as a sequence of slices."""

    name: str
    slices: tuple[tuple[Convolution | MaxPool, ...], ...]
    least_px: int
    """Smallest image side; smaller images leave no pixel in the last slice."""

    @property
    def channels(self) -> tuple[int, ...]:
        """Channels of the output of each slice."""
        return tuple(layers[-1].outputs for layers in self.slices)

    def convolutions(self) -> dict[str, Convolution]:
        """Every convolution by its LPIPS name, such as ``net.slice1.0``."""
        return {
            f"net.slice{number}.{layer.index}": layer
            for number, layers in enumerate(self.slices, 1)
            for layer in layers
            if isinstance(layer, Convolution)
        }

    def outputs(self, images: Tensor, weights: dict[str, Tensor]) -> list[Tensor]:
        """Outputs of all slices for ``n 3 h w`` images."""
        outputs = []
        for number, layers in enumerate(self.slices, 1):
            for layer in layers:
                images = _apply(layer, f"net.slice{number}", images, weights)
            outputs.append(images)
        return outputs


def _apply(
    layer: Convolution | MaxPool, prefix: str, images: Tensor, weights: dict[str, Tensor]
) -> Tensor:
    if isinstance(layer, MaxPool):
        return torch.nn.functional.max_pool2d(images, layer.kernel, layer.stride)
    name = f"{prefix}.{layer.index}"
    return torch.nn.functional.conv2d(
        images,
        weights[f"{name}.weight"],
        weights[f"{name}.bias"],
        stride=layer.stride,
        padding=layer.padding,
    ).relu()


VGG16 = Backbone(
    name="vgg",
    slices=(
        (Convolution(0, 3, 64), Convolution(2, 64, 64)),
        (MaxPool(2), Convolution(5, 64, 128), Convolution(7, 128, 128)),
        (
            MaxPool(2),
            *(Convolution(10, 128, 256), Convolution(12, 256, 256), Convolution(14, 256, 256)),
        ),
        (
            MaxPool(2),
            *(Convolution(17, 256, 512), Convolution(19, 512, 512), Convolution(21, 512, 512)),
        ),
        (
            MaxPool(2),
            *(Convolution(24, 512, 512), Convolution(26, 512, 512), Convolution(28, 512, 512)),
        ),
    ),
    least_px=16,
)
ALEXNET = Backbone(
    name="alex",
    slices=(
        (Convolution(0, 3, 64, kernel=11, stride=4, padding=2),),
        (MaxPool(3), Convolution(3, 64, 192, kernel=5, padding=2)),
        (MaxPool(3), Convolution(6, 192, 384)),
        (Convolution(8, 384, 256),),
        (Convolution(10, 256, 256),),
    ),
    least_px=31,
)
BACKBONES = {backbone.name: backbone for backbone in (VGG16, ALEXNET)}
