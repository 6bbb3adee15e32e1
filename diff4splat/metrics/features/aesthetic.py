"""Aesthetic score: linear layers on CLIP embeddings, with weights that a user has.

Axes: ``n`` images, ``d`` features. The layout of the improved aesthetic predictor (LAION): weights
``layers.0``, ``layers.2``, … without activations between them; dropout is left out.
"""

import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from diff4splat.errors import CheckpointError
from diff4splat.metrics.features.protocol import ImageFeatures
from diff4splat.metrics.features.tensor_files import digest, read_tensors


@dataclass(frozen=True, slots=True, eq=False)
class AestheticScore:
    """A number per image, about 1 to 10."""

    features: ImageFeatures
    layers: tuple[tuple[Tensor, Tensor], ...]
    """Weight and bias of each."""

    @property
    def name(self) -> str:
        """The head, and the features that it judges."""
        weights = {str(index): weight for index, (weight, _) in enumerate(self.layers)}
        return f"aesthetic score (weights {digest(weights)[:8]}) on {self.features.name}"

    def score(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, " n"]:
        """Score of each image."""
        state = functional.normalize(self.features.embed_images(images), dim=-1)
        for weight, bias in self.layers:
            state = functional.linear(state, weight, bias)
        return state[:, 0]


def read_aesthetic(file: Path, features: ImageFeatures) -> AestheticScore:
    """The head of a file.

    Raises:
        CheckpointError: no layers, or layers that do not fit each other.
        FileFormatError: the file is damaged.
    """
    found = read_tensors(file)
    names = [re.fullmatch(r"layers\.(\d+)\.weight", key) for key in found]
    numbers = sorted(int(name[1]) for name in names if name)
    parts = [(f"layers.{number}.weight", f"layers.{number}.bias") for number in numbers]
    if not parts or any(bias not in found for _, bias in parts):
        raise CheckpointError(
            f"{file}: expected layers.0.weight, layers.0.bias and so on, got other names; "
            "choose the weights of an aesthetic predictor"
        )
    layers = tuple((found[weight].float(), found[bias].float()) for weight, bias in parts)
    fits = all(one[0].shape[0] == two[0].shape[1] for one, two in pairwise(layers))
    if not fits or layers[-1][0].shape[0] != 1:
        raise CheckpointError(f"{file}: expected layers that end in one number, got other shapes")
    return AestheticScore(features=features, layers=layers)
