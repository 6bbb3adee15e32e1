"""Where the rays of a pixel go: Owen-scrambled Sobol' points over aperture, pixel and exposure.

Axes: ``p`` pixels, ``s`` samples. The aperture gets the first two dimensions, spread best of all.
"""

from jaxtyping import Int
from torch import Tensor

from diff4splat.render.physical.concentric_disc import disc_points
from diff4splat.render.physical.effects import Effects
from diff4splat.render.physical.sensor import Draws
from diff4splat.render.physical.sobol import sample_points


def draw(effects: Effects, pixels: Int[Tensor, " p"], seed: int) -> Draws:
    """Samples of ``pixels`` for the effects that there are; those of a pixel are its own."""
    wanted = 2 * effects.spreads + 2 * effects.covers + effects.exposes
    if wanted == 0:
        return Draws()
    points = sample_points(pixels, effects.samples, wanted, seed)
    on_lens = disc_points(points[..., :2]) if effects.spreads else None
    used = 2 * effects.spreads
    in_pixel = points[..., used : used + 2] - 0.5 if effects.covers else None
    in_exposure = points[..., -1] if effects.exposes else None
    return Draws(in_pixel=in_pixel, on_lens=on_lens, in_exposure=in_exposure)
