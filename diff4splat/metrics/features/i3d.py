"""I3D (Carreira and Zisserman 2017), without its weights: what FVD and KVD are measured with.

Axes: ``n`` videos, ``t`` frames, ``c`` channels, ``h w`` pixels. RGB in [0, 1] here; the network
takes 224 px and [−1, 1]. Features are the class scores before the softmax, averaged over time, as
in FVD (Unterthiner et al. 2018). Weights by the names of pytorch-i3d's state, ``rgb_imagenet.pt``.
Padding is TensorFlow's "same": the odd pixel comes last.
"""

from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.metrics.checks import promote
from diff4splat.metrics.features.tensor_files import digest, read_tensors, require_weights

SIDE_PX = 224
POOLED = (2, 7, 7)
"""Window of the last average, cut where videos are shorter or smaller."""
NORM_EPSILON = 1e-3
MIXED_CHANNELS = {
    "Mixed_3b": (192, 64, 96, 128, 16, 32, 32),
    "Mixed_3c": (256, 128, 128, 192, 32, 96, 64),
    "Mixed_4b": (480, 192, 96, 208, 16, 48, 64),
    "Mixed_4c": (512, 160, 112, 224, 24, 64, 64),
    "Mixed_4d": (512, 128, 128, 256, 24, 64, 64),
    "Mixed_4e": (512, 112, 144, 288, 32, 64, 64),
    "Mixed_4f": (528, 256, 160, 320, 32, 128, 128),
    "Mixed_5b": (832, 256, 160, 320, 32, 128, 128),
    "Mixed_5c": (832, 384, 192, 384, 48, 128, 128),
}
"""Inputs, then outputs of the branches b0, b1a, b1b, b2a, b2b, b3b."""
FEATURES, CLASSES = 1024, 400
POOLS = {
    "Conv3d_2b_1x1": ((1, 3, 3), (1, 2, 2)),
    "Mixed_3b": ((1, 3, 3), (1, 2, 2)),
    "Mixed_4b": ((3, 3, 3), (2, 2, 2)),
    "Mixed_5b": ((2, 2, 2), (2, 2, 2)),
}
"""Window and stride of the maximum before a layer."""
STEM = ("Conv3d_1a_7x7", "Conv3d_2b_1x1", "Conv3d_2c_3x3")


@dataclass(frozen=True, slots=True, eq=False)
class I3d:
    """``VideoFeatures`` with given weights."""

    weights: dict[str, Tensor]
    side_px: int = SIDE_PX

    @property
    def name(self) -> str:
        """The network, and the first digits of the SHA-256 of its weights."""
        return f"I3D (weights {digest(self.weights)[:8]})"

    @torch.no_grad()
    def embed_videos(self, videos: Float[Tensor, "n t 3 h w"]) -> Float[Tensor, "n d"]:
        """Class scores of each video, one video at a time."""
        (videos,) = promote(videos)
        return torch.stack([self._scores(video) for video in videos])

    def _scores(self, video: Float[Tensor, "t 3 h w"]) -> Float[Tensor, " d"]:
        size = (self.side_px, self.side_px)
        video = torch.nn.functional.interpolate(video, size, mode="bilinear", align_corners=False)
        state = 2 * video.movedim(0, 1)[None] - 1
        for layer in (*STEM, *MIXED_CHANNELS):
            if layer in POOLS:
                state = _max_pool(state, *POOLS[layer])
            if layer in MIXED_CHANNELS:
                state = self._mixed(layer, state)
            else:
                state = self._unit(layer, state, 2 if layer == STEM[0] else 1)
        window = [min(full, size) for full, size in zip(POOLED, state.shape[2:], strict=True)]
        pooled = torch.nn.functional.avg_pool3d(state, window, stride=1)
        weight, bias = (self.weights[f"logits.conv3d.{part}"] for part in ("weight", "bias"))
        return torch.nn.functional.conv3d(pooled, weight, bias).mean((2, 3, 4))[0]

    def _mixed(self, layer: str, state: Tensor) -> Tensor:
        first = self._unit(f"{layer}.b0", state)
        second = self._unit(f"{layer}.b1b", self._unit(f"{layer}.b1a", state))
        third = self._unit(f"{layer}.b2b", self._unit(f"{layer}.b2a", state))
        fourth = self._unit(f"{layer}.b3b", _max_pool(state, (3, 3, 3), (1, 1, 1)))
        return torch.cat([first, second, third, fourth], 1)

    def _unit(self, layer: str, state: Tensor, stride: int = 1) -> Tensor:
        """Convolution, normalisation by stored moments, rectifier."""
        weight = self.weights[f"{layer}.conv3d.weight"]
        state = _padded(state, tuple(weight.shape[2:]), (stride,) * 3)
        state = torch.nn.functional.conv3d(state, weight, stride=stride)
        mean, variance, scale, shift = (
            self.weights[f"{layer}.bn.{part}"]
            for part in ("running_mean", "running_var", "weight", "bias")
        )
        normed = torch.nn.functional.batch_norm(
            state, mean, variance, scale, shift, eps=NORM_EPSILON
        )
        return normed.relu()


def read_i3d(file: Path) -> I3d:
    """I3D with the weights of a file, for any number of classes.

    Raises:
        CheckpointError, FileFormatError: the file cannot be used.
    """
    found = read_tensors(file)
    classes = found["logits.conv3d.bias"].numel() if "logits.conv3d.bias" in found else CLASSES
    return I3d(weights=require_weights(found, expected_shapes(classes), "I3D weights"))


def expected_shapes(classes: int = CLASSES) -> dict[str, tuple[int, ...]]:
    """Name and shape of every weight."""
    shapes = _unit_shapes(STEM[0], 3, 64, 7) | _unit_shapes(STEM[1], 64, 64, 1)
    shapes |= _unit_shapes(STEM[2], 64, 192, 3)
    for layer, (inputs, b0, b1a, b1b, b2a, b2b, b3b) in MIXED_CHANNELS.items():
        shapes |= _unit_shapes(f"{layer}.b0", inputs, b0, 1)
        shapes |= _unit_shapes(f"{layer}.b1a", inputs, b1a, 1)
        shapes |= _unit_shapes(f"{layer}.b1b", b1a, b1b, 3)
        shapes |= _unit_shapes(f"{layer}.b2a", inputs, b2a, 1)
        shapes |= _unit_shapes(f"{layer}.b2b", b2a, b2b, 3)
        shapes |= _unit_shapes(f"{layer}.b3b", inputs, b3b, 1)
    logits = {"weight": (classes, FEATURES, 1, 1, 1), "bias": (classes,)}
    return shapes | {f"logits.conv3d.{part}": shape for part, shape in logits.items()}


def _unit_shapes(layer: str, inputs: int, outputs: int, side: int) -> dict[str, tuple[int, ...]]:
    shapes = {f"{layer}.conv3d.weight": (outputs, inputs, side, side, side)}
    for part in ("weight", "bias", "running_mean", "running_var"):
        shapes[f"{layer}.bn.{part}"] = (outputs,)
    return shapes


def _max_pool(state: Tensor, window: tuple[int, ...], stride: tuple[int, ...]) -> Tensor:
    return torch.nn.functional.max_pool3d(_padded(state, window, stride), window, stride)


def _padded(state: Tensor, window: tuple[int, ...], stride: tuple[int, ...]) -> Tensor:
    sides: list[int] = []
    for size, length, step in zip(state.shape[2:], window, stride, strict=True):
        total = max(length - (size % step or step), 0)
        # torch lists the last axis first.
        sides = [total // 2, total - total // 2, *sides]
    return torch.nn.functional.pad(state, sides)
