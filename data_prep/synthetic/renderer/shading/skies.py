"""What a ray sees that meets nothing: a gradient, a sun with its glow, clouds; and haze.

World axes: y points down, so a ray goes up where its y is negative.
"""

from typing import NamedTuple

import numpy as np

from diff4splat.data_prep.synthetic.renderer.numerics import blend, clamp, dot, ramp
from diff4splat.data_prep.synthetic.renderer.textures.noise import flat_octaves
from diff4splat.data_prep.synthetic.world import World
from diff4splat.kernels.jit import inlined, shared


class Lighting(NamedTuple):
    """Light and sky as plain numbers."""

    color: np.ndarray
    toward: np.ndarray
    above: np.ndarray
    below: np.ndarray
    zenith: np.ndarray
    horizon: np.ndarray
    softness: float
    clouds: float
    haze_per_m: float
    seed: int
    exposure: float
    handed_on: float
    """Share of the light from all around that walls return to where objects hide it."""


_FILL = 1.2
"""Light that surfaces hand on to each other adds to that from all around."""
_WALLS = 0.45
"""``handed_on`` in a room; outdoors that light is gone."""


def lighting_of(world: World) -> Lighting:
    """A world's light, exposed so that what is white and lit is nearly white in the image."""
    light, sky = world.light, world.sky
    facing = max(float(-light.toward[1]), 0.35)
    level = 0.85 * facing * _luminance(light.color) + 0.7 * _luminance(light.sky)
    exposure = 0.66 / max(level, 1e-6)
    # Colours of a sky are as they shall look, those of light as bright as it is.
    arrays = (light.color, light.toward, _FILL * light.sky, _FILL * light.ground)
    skies = (sky.zenith / exposure, sky.horizon / exposure)
    # Outdoors the air is never perfectly clear.
    is_room = sky.haze_per_m == 0 and sky.clouds == 0
    return Lighting(
        *(np.ascontiguousarray(value, np.float64) for value in arrays + skies),
        float(light.softness),
        float(sky.clouds),
        float(sky.haze_per_m),
        int(sky.seed),
        exposure,
        _WALLS if is_room else 0.0,
    )


def _luminance(color: np.ndarray) -> float:
    """Of linear Rec. 709 light."""
    return float(0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2])


@inlined
def ambient(y, lighting, channel):
    """The sky without sun and clouds, the ground below: for reflections and haze."""
    if y > 0.0:
        share = clamp(6.0 * y, 0.0, 1.0)
        return blend(lighting.horizon[channel], lighting.below[channel], share)
    rise = clamp(-y, 0.0, 1.0)
    share = 1.0 - (1.0 - rise) * (1.0 - rise) * (1.0 - rise)
    return blend(lighting.horizon[channel], lighting.zenith[channel], share)


@shared
def sky(x, y, z, lighting):
    """Linear RGB along a unit direction."""
    red = ambient(y, lighting, 0)
    green = ambient(y, lighting, 1)
    blue = ambient(y, lighting, 2)
    toward = dot(x, y, z, lighting.toward[0], lighting.toward[1], lighting.toward[2])
    near_sun = clamp(toward, 0.0, 1.0)
    glow = near_sun * near_sun
    glow = glow * glow * glow
    glow = 0.10 * glow + 0.35 * glow * glow * glow * glow
    if lighting.clouds > 0.0 and y < 0.0:
        # Clouds on a plane overhead, drawn out towards the horizon as perspective does.
        lift = 0.15 - y
        px, pz = 0.9 * x / lift, 0.9 * z / lift
        cover = flat_octaves(px, pz, 0.012 / lift, lighting.seed, 5)
        level = 1.3 - 2.6 * lighting.clouds
        share = ramp(cover, level, level + 1.6) * clamp(-7.0 * y, 0.0, 1.0)
        thick = ramp(cover, level + 0.6, level + 2.6)
        bright = blend(1.0, 0.62, thick) * (1.0 + glow)
        white = 0.45 * (lighting.color[0] + lighting.color[1] + lighting.color[2]) / 3.0
        red = blend(red, bright * (0.5 * lighting.above[0] + white), 0.85 * share)
        green = blend(green, bright * (0.5 * lighting.above[1] + white), 0.85 * share)
        blue = blend(blue, bright * (0.5 * lighting.above[2] + white), 0.85 * share)
        glow *= 1.0 - 0.5 * share
    disc = ramp(toward, 0.9994, 0.9998) * 4.0
    glow += disc
    return (
        red + glow * lighting.color[0],
        green + glow * lighting.color[1],
        blue + glow * lighting.color[2],
    )
