"""What every lens can do: image-plane coordinates to directions and back.

Image-plane coordinates of the pixel (x, y) are ((x - c_x) / f_x, (y - c_y) / f_y) with the focal
lengths and the centre of a ``Camera``, so a lens knows nothing of pixels. Their unit belongs to the
lens: tangents (pinhole), distorted angles (OpenCV fisheye), millimetres (Blender) or radians
(equirectangular). Directions are in camera axes: x right, y down, z forward.
"""

from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Float
from torch import Tensor


@runtime_checkable
class Lens(Protocol):
    """A mapping of the image plane to directions, and its inverse.

    Coefficients, points and directions get gradients. Where a value does not exist, the mask is
    False and the numbers are the direction (0, 0, 1) or the point (0, 0) with zero gradient.
    """

    def directions(
        self, points: Float[Tensor, "*b 2"]
    ) -> tuple[Float[Tensor, "*b 3"], Bool[Tensor, "*b"]]:
        """Unit directions seen at points of the image plane, and which of them exist."""
        ...

    def points(
        self, directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b 2"], Bool[Tensor, "*b"]]:
        """Where directions of any length fall on the image plane, and which of them do."""
        ...

    def to(self, target: torch.device | torch.dtype) -> "Lens":
        """Move or cast every tensor."""
        ...
