"""What a perceptual distance is, so that losses and tables need not know which one it is.

Axes: ``n`` images, ``h w`` pixels. RGB in [0, 1].
"""

from typing import Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor


@runtime_checkable
class PerceptualFeatures(Protocol):
    """A distance between images that should agree with people's judgement."""

    @property
    def name(self) -> str:
        """For tables: which network and weights, or that it is a stand-in."""
        ...

    def distance(
        self, image: Float[Tensor, "n 3 h w"], reference: Float[Tensor, "n 3 h w"]
    ) -> Float[Tensor, " n"]:
        """0 for equal images, more for worse ones; differentiable, float32 or better."""
        ...
