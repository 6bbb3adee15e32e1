"""Matching light and sky: sun at any height, overcast, lamps indoors, under water.

Colours are linear and only their ratios matter, since images are auto-exposed.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS, SceneKind
from diff4splat.data_prep.synthetic.palettes import linear_from_hex
from diff4splat.data_prep.synthetic.quantise import COLOR_BITS, POSE_BITS, quantise, quantise_number
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.world import Light, Sky

LOW_HILLS_M = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LightingPreset:
    """One preset; colours as hexadecimal sRGB, with strengths."""

    sun: str
    sun_strength: float
    sky_strength: float
    elevation_deg: tuple[float, float]
    zenith: str
    horizon: str
    bounce: str
    clouds: tuple[float, float] = (0.0, 0.5)
    softness: tuple[float, float] = (0.01, 0.03)
    haze: float = 1.0
    weight: float = 1.0


OUTDOORS: dict[str, LightingPreset] = {
    "high sun": LightingPreset(
        sun="fff6e8",
        sun_strength=2.6,
        sky_strength=0.75,
        elevation_deg=(42.0, 68.0),
        zenith="3f78bd",
        horizon="c3d9ea",
        bounce="6f6a58",
        clouds=(0.1, 0.55),
        weight=2.0,
    ),
    "afternoon": LightingPreset(
        sun="ffe3bd",
        sun_strength=2.5,
        sky_strength=0.62,
        elevation_deg=(24.0, 42.0),
        zenith="4a80bf",
        horizon="dfe2dc",
        bounce="6f6250",
        weight=2.0,
    ),
    "low sun": LightingPreset(
        sun="ffb877",
        sun_strength=2.4,
        sky_strength=0.5,
        elevation_deg=(11.0, 20.0),
        zenith="5878a8",
        horizon="f2cda0",
        bounce="6a5548",
        haze=1.8,
    ),
    "overcast": LightingPreset(
        sun="eef2f6",
        sun_strength=0.7,
        sky_strength=1.3,
        elevation_deg=(45.0, 70.0),
        zenith="a3afbb",
        horizon="ced5da",
        bounce="6e6e6a",
        clouds=(0.85, 1.0),
        softness=(0.2, 0.35),
        haze=2.2,
        weight=1.3,
    ),
    "dusk": LightingPreset(
        sun="ffa984",
        sun_strength=1.2,
        sky_strength=0.75,
        elevation_deg=(9.0, 15.0),
        zenith="4a5a80",
        horizon="d8aa98",
        bounce="524c54",
        haze=2.0,
        weight=0.6,
    ),
}
INDOORS: dict[str, LightingPreset] = {
    "daylight": LightingPreset(
        sun="fff3e2",
        sun_strength=1.8,
        sky_strength=0.95,
        elevation_deg=(38.0, 62.0),
        zenith="d8d4ca",
        horizon="cfcabf",
        bounce="8a7c68",
        softness=(0.05, 0.14),
        weight=2.0,
    ),
    "lamp": LightingPreset(
        sun="ffd09a",
        sun_strength=2.0,
        sky_strength=0.62,
        elevation_deg=(48.0, 72.0),
        zenith="8a7458",
        horizon="7a664e",
        bounce="6f553c",
        softness=(0.08, 0.18),
        weight=1.2,
    ),
    "north window": LightingPreset(
        sun="e4eefc",
        sun_strength=1.5,
        sky_strength=0.9,
        elevation_deg=(32.0, 48.0),
        zenith="c2c8d0",
        horizon="b8bec6",
        bounce="6c675f",
        softness=(0.15, 0.3),
        weight=1.5,
    ),
    "evening": LightingPreset(
        sun="ffb469",
        sun_strength=2.1,
        sky_strength=0.5,
        elevation_deg=(24.0, 36.0),
        zenith="6a5a58",
        horizon="5c5054",
        bounce="5c4638",
        softness=(0.02, 0.06),
        weight=0.8,
    ),
}
UNDER_WATER: dict[str, LightingPreset] = {
    "clear water": LightingPreset(
        sun="bfe9e2",
        sun_strength=1.9,
        sky_strength=0.9,
        elevation_deg=(58.0, 78.0),
        zenith="7fc4cc",
        horizon="2f7f92",
        bounce="4f7a78",
        clouds=(0.0, 0.0),
        softness=(0.06, 0.15),
    ),
    "deep water": LightingPreset(
        sun="8fc8d6",
        sun_strength=1.4,
        sky_strength=0.8,
        elevation_deg=(60.0, 80.0),
        zenith="4a8fae",
        horizon="1d4f70",
        bounce="2f5a6c",
        clouds=(0.0, 0.0),
        softness=(0.1, 0.25),
    ),
}


def sample_any_lighting(rng: Rng) -> tuple[Light, Sky]:
    """Light and sky of a random kind of scene without high hills, for places of no kind."""
    kinds = sorted(name for name, kind in SCENE_KINDS.items() if kind.hills_m[1] < LOW_HILLS_M)
    return sample_lighting(SCENE_KINDS[rng.choice(kinds)], 1.0, rng.child("light"))


def sample_lighting(kind: SceneKind, area_radius_m: float, rng: Rng) -> tuple[Light, Sky]:
    """Sample a light and its sky; indoors the light is never behind the back walls."""
    moods = UNDER_WATER if kind.is_under_water else INDOORS if kind.is_indoors else OUTDOORS
    mood = rng.weighted_choice(list(moods.values()), [mood.weight for mood in moods.values()])
    open_walls = kind.is_indoors or "street" in kind.tags
    azimuth = rng.uniform(-0.75, 0.75) + np.pi if open_walls else rng.uniform(0.0, 2 * np.pi)
    sun = linear_from_hex(mood.sun) * mood.sun_strength * rng.uniform(0.85, 1.15)
    zenith, horizon = linear_from_hex(mood.zenith), linear_from_hex(mood.horizon)
    light = Light(
        color=quantise(sun, COLOR_BITS),
        toward=_toward(azimuth, np.radians(rng.uniform(*mood.elevation_deg))),
        sky=quantise(
            (0.55 * zenith + 0.45 * horizon) / _mean(zenith, horizon) * 0.6 * mood.sky_strength,
            COLOR_BITS,
        ),
        ground=quantise(linear_from_hex(mood.bounce) * mood.sky_strength, COLOR_BITS),
        softness=quantise_number(rng.uniform(*mood.softness)),
    )
    return light, _sky(kind, mood, area_radius_m, rng)


def _mean(a: Float64[np.ndarray, "3"], b: Float64[np.ndarray, "3"]) -> float:
    return float((0.55 * a + 0.45 * b).mean())


def _toward(azimuth: float, elevation: float) -> Float64[np.ndarray, "3"]:
    level = np.cos(elevation)
    return quantise(
        np.array([level * np.sin(azimuth), -np.sin(elevation), level * np.cos(azimuth)]), POSE_BITS
    )


def _sky(kind: SceneKind, mood: LightingPreset, area_radius_m: float, rng: Rng) -> Sky:
    if kind.is_under_water:
        haze = rng.uniform(0.12, 0.25) / area_radius_m
    else:
        haze = 0.0 if kind.is_indoors else rng.uniform(0.001, 0.006) * mood.haze
    brightness = rng.uniform(0.85, 1.1)
    return Sky(
        zenith=quantise(linear_from_hex(mood.zenith) * brightness, COLOR_BITS),
        horizon=quantise(linear_from_hex(mood.horizon) * brightness, COLOR_BITS),
        clouds=0.0 if kind.is_indoors else quantise_number(rng.uniform(*mood.clouds)),
        haze_per_m=quantise_number(haze, 20),
        seed=rng.random_seed(),
    )
