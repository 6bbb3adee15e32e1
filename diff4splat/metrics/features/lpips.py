"""LPIPS, version 0.1 (Zhang et al., arXiv 1801.03924), without its weights.

Axes: ``n`` images, ``h w`` pixels. RGB in [0, 1] here; the published networks take [−1, 1].

    distance = Σ_slices mean_{h w} Σ_channels w_c (f̂_c − ĝ_c)²,     f̂ = f / (‖f‖₂ + 1e-10)

with f and g the outputs of a slice for both images, and w the ``lin`` weights. The same numbers
as the ``lpips`` package with ``normalize=True``; what it multiplies by during training (dropout)
is left out, because nothing is trained here.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.metrics.checks import no_autocast, promote, require_alike
from diff4splat.metrics.features.backbones import Backbone
from diff4splat.metrics.features.tensor_files import digest

SHIFT = (-0.030, -0.088, -0.188)
SCALE = (0.458, 0.448, 0.450)
"""ImageNet's mean and deviation, for images in [−1, 1]."""
NORM_FLOOR = 1e-10


class Lpips:
    """LPIPS with given weights, all of them frozen; a ``PerceptualFeatures``."""

    def __init__(self, trunk: Backbone, weights: dict[str, Tensor]) -> None:
        """``weights`` by the names of ``lpips_weights.expected_shapes``."""
        self._trunk = trunk
        self._weights = {key: value.detach() for key, value in weights.items()}
        self._digest = digest(self._weights)

    @property
    def name(self) -> str:
        """The network, and the first digits of the SHA-256 of its weights."""
        return f"LPIPS-{self._trunk.name} (weights {self._digest[:8]})"

    def distance(
        self, image: Float[Tensor, "n 3 h w"], reference: Float[Tensor, "n 3 h w"]
    ) -> Float[Tensor, " n"]:
        """LPIPS of each pair; finite gradients, and 0 with zero gradient for equal images.

        Raises:
            ShapeError: the shapes differ, or a side is below the trunk's ``least_px``.
        """
        require_alike("image", image, reference)
        self._require_size(image)
        images = torch.cat(promote(image, reference))
        with no_autocast(images):
            weights = self._weights_like(images)
            slices = self._trunk.outputs(_standardized(images), weights)
            parts = [
                _slice_distance(output, weights[f"lin{number}.model.1.weight"])
                for number, output in enumerate(slices)
            ]
        return torch.stack(parts).sum(0)

    def _weights_like(self, images: Tensor) -> dict[str, Tensor]:
        first = next(iter(self._weights.values()))
        if first.device != images.device or first.dtype != images.dtype:
            # Kept, so that a training moves them to its device once.
            self._weights = {key: value.to(images) for key, value in self._weights.items()}
        return self._weights

    def _require_size(self, image: Tensor) -> None:
        least = self._trunk.least_px
        if min(image.shape[-2:]) < least:
            height, width = image.shape[-2:]
            raise ShapeError(
                f"LPIPS-{self._trunk.name}: expected images of at least {least} px a side, "
                f"got {height} by {width}; enlarge them or use the stand-in"
            )


def _standardized(images: Tensor) -> Tensor:
    shift, scale = (images.new_tensor(values)[:, None, None] for values in (SHIFT, SCALE))
    return (2 * images - 1 - shift) / scale


def _slice_distance(output: Tensor, head: Tensor) -> Tensor:
    """One slice's share; ``output`` holds all images and then all references."""
    # The gradient of this norm is 0 at 0, where that of sqrt would be infinite.
    norm = torch.linalg.vector_norm(output, dim=1, keepdim=True)
    image, reference = (output / (norm + NORM_FLOOR)).chunk(2)
    return ((image - reference).square() * head.flatten()[:, None, None]).sum(1).mean((-2, -1))
