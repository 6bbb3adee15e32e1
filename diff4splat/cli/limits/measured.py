"""How far a result is from the photograph or from the reference setting, measured after a run."""

import math

from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.image_detail import resized


def frame_error(frame: Float[Tensor, "h w 3"], reference: Float[Tensor, "hh ww 3"]) -> float:
    """Mean square difference of a frame, enlarged where it is smaller, from the reference's."""
    image = frame.clamp(0, 1).movedim(-1, 0)[None].float()
    scaled = resized(image, reference.shape[:2])[0].movedim(0, -1)
    error = float((scaled - reference.float().clamp(0, 1)).square().mean())
    return error if math.isfinite(error) else math.inf
