"""Structural similarity of images (Wang et al., IEEE TIP 2004).

Axes: ``*b`` images, ``h w`` pixels. RGB in [0, 1].

    SSIM = (2 μ_x μ_y + C1)(2 σ_xy + C2) / ((μ_x² + μ_y² + C1)(σ_x² + σ_y² + C2))

with C1 = 0.01², C2 = 0.03², local moments under an 11×11 Gaussian window of deviation 1.5, and the
mean over the three channels and over all windows inside the image, as in the authors' program and
in scikit-image.
"""

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ShapeError
from diff4splat.metrics.checks import promote, require_alike

WINDOW_PX = 11


def ssim(
    image: Float[Tensor, "*b h w 3"], reference: Float[Tensor, "*b h w 3"]
) -> Float[Tensor, "*b"]:
    """SSIM of each image: 1 if equal, around 0 if unrelated; differentiable.

    Raises:
        ShapeError: the shapes differ, or a side is below 11 px.
    """
    # Imported here because loading takes half a second.
    from kornia.metrics import ssim as ssim_map

    require_alike("image", image, reference)
    if image.ndim < 3 or min(image.shape[-3:-1]) < WINDOW_PX:
        raise ShapeError(
            f"image: expected h w 3 with at least {WINDOW_PX} px a side, got {tuple(image.shape)}"
        )
    batch = image.shape[:-3]
    one, other = (
        rgb.reshape(batch.numel(), *rgb.shape[-3:]).movedim(-1, 1)
        for rgb in promote(image, reference)
    )
    similarity = ssim_map(one, other, WINDOW_PX, eps=0.0, padding="valid")
    return similarity.mean((1, 2, 3)).reshape(batch)
