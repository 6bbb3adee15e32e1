"""Materials: from a role and a palette to a texture.

A role lists its suitable textures. ``per`` is the unit of the number of features: ``metre`` for
patterns of fixed size (bricks, boards, blades of grass), ``thing`` for patterns that scale with the
object (painted dots). Textures that grow inside a material are
solid.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from diff4splat.captions.colors import color_name, linear_from_srgb
from diff4splat.data_prep.synthetic.palettes import Palette
from diff4splat.data_prep.synthetic.quantise import (
    COLOR_BITS,
    POSE_BITS,
    quantise,
    quantise_number,
)
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import PartImage
from diff4splat.data_prep.synthetic.world import Texture

SOLID = frozenset({"marble", "noise", "rust"})
RELIEF = {
    "brick": 0.12,
    "stone": 0.25,
    "tiles": 0.05,
    "planks": 0.06,
    "grass": 0.3,
    "leaves": 0.25,
    "fabric": 0.15,
    "scales": 0.15,
    "plaster": 0.04,
    "rust": 0.1,
    "wood": 0.02,
}
"""Depth of the pattern in features."""
DOMINANT = {"stripes": 1}
"""Index of the dominant colour, if it is not the first."""


@dataclass(frozen=True, slots=True)
class Option:
    """A texture that suits a role."""

    family: str
    features: tuple[float, float]
    per: Literal["metre", "thing"] = "thing"
    gloss: float = 0.1
    second: Literal["darker", "lighter", "pale", "other"] = "darker"
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class MaterialRole:
    """Palette colours and textures of a material."""

    colors: str
    options: tuple[Option, ...]


def _role(colors: str, *options: Option) -> MaterialRole:
    return MaterialRole(colors, options)


_PAINT = (
    Option("plain", (2.0, 4.0), gloss=0.35, weight=2.0),
    Option("noise", (3.0, 6.0), gloss=0.15),
    Option("stripes", (3.0, 6.0), gloss=0.3, second="pale"),
    Option("checker", (3.0, 5.0), gloss=0.3, second="pale", weight=0.7),
    Option("dots", (3.0, 6.0), gloss=0.35, second="pale"),
    Option("fabric", (7.0, 12.0), gloss=0.0, second="other", weight=0.7),
    Option("rust", (2.0, 4.0), gloss=0.2, second="darker", weight=0.6),
    Option("marble", (2.0, 4.0), gloss=0.6, second="lighter", weight=0.6),
    Option("wood", (2.0, 4.0), gloss=0.25, weight=0.6),
)
_TIMBER = (
    Option("wood", (3.0, 7.0), gloss=0.2, weight=2.0),
    Option("planks", (5.0, 9.0), gloss=0.15),
)
_MASONRY = (
    Option("stone", (3.0, 6.0), "metre"),
    Option("noise", (2.0, 5.0)),
    Option("plaster", (2.0, 5.0)),
    Option("marble", (1.5, 3.0), gloss=0.5, second="lighter"),
)
_GREEN = (
    Option("leaves", (6.0, 12.0), gloss=0.1),
    Option("noise", (4.0, 9.0), gloss=0.1),
)
ROLES: dict[str, MaterialRole] = {
    "painted": _role("paint", *_PAINT),
    "toy": _role("paint", *_PAINT),
    "accent": _role("paint", Option("plain", (2.0, 4.0), gloss=0.3), Option("noise", (3.0, 6.0))),
    "coat": _role(
        "paint",
        Option("plain", (2.0, 3.0), gloss=0.8, weight=3.0),
        Option("rust", (2.0, 4.0), gloss=0.3),
    ),
    "machine": _role(
        "paint",
        Option("plain", (2.0, 4.0), gloss=0.5, weight=2.0),
        Option("rust", (2.0, 4.0)),
        Option("stripes", (5.0, 8.0), second="pale"),
    ),
    "book": _role(
        "paint",
        Option("plain", (2.0, 3.0)),
        Option("lettering", (5.0, 8.0), second="pale"),
        Option("fabric", (8.0, 12.0)),
    ),
    "crate": _role(
        "wood",
        Option("planks", (4.0, 6.0), weight=2.0),
        Option("wood", (3.0, 5.0)),
        Option("lettering", (3.0, 4.0), second="darker", weight=0.7),
    ),
    "wood": _role("wood", *_TIMBER),
    "staves": _role("wood", Option("planks", (6.0, 9.0)), Option("wood", (4.0, 6.0))),
    "fence": _role(
        "pale",
        Option("plain", (2.0, 4.0)),
        Option("wood", (3.0, 6.0)),
        Option("plaster", (3.0, 5.0)),
    ),
    "bark": _role("wood", Option("noise", (8.0, 14.0)), Option("wood", (5.0, 8.0))),
    "ceramic": _role(
        "paint",
        *_PAINT[:5],
        Option("marble", (2.0, 4.0), gloss=0.6, second="lighter"),
        Option("tiles", (5.0, 8.0), gloss=0.6, second="pale", weight=0.4),
    ),
    "glass": _role("leaf", Option("plain", (2.0, 4.0), gloss=0.9)),
    "shade": _role("pale", Option("fabric", (10.0, 16.0)), Option("plain", (2.0, 4.0))),
    "cap": _role(
        "paint",
        Option("dots", (3.0, 5.0), second="pale", gloss=0.4),
        Option("noise", (3.0, 6.0)),
    ),
    "pumpkin": _role(
        "brick",
        Option("noise", (3.0, 5.0), gloss=0.25),
        Option("stripes", (5.0, 8.0), gloss=0.2),
    ),
    "pot": _role(
        "brick",
        Option("plain", (3.0, 5.0)),
        Option("noise", (4.0, 7.0)),
        Option("dots", (5.0, 8.0), second="pale"),
    ),
    "stone": _role(
        "stone",
        Option("noise", (4.0, 8.0)),
        Option("marble", (2.0, 4.0), gloss=0.5, second="lighter"),
        Option("plaster", (3.0, 6.0)),
    ),
    "rock": _role(
        "stone",
        Option("noise", (3.0, 7.0), weight=2.0),
        Option("plaster", (3.0, 6.0)),
        Option("marble", (2.0, 4.0), weight=0.5),
    ),
    "block": _role("stone", *_MASONRY),
    "leaf": _role("leaf", *_GREEN),
    "needle": _role("leaf", Option("leaves", (10.0, 18.0)), Option("grass", (10.0, 18.0))),
    "grass": _role("leaf", Option("noise", (3.0, 6.0)), Option("grass", (6.0, 12.0))),
    "petal": _role("paint", Option("plain", (2.0, 4.0)), Option("noise", (2.0, 4.0))),
    "scales": _role(
        "paint",
        Option("scales", (10.0, 16.0), gloss=0.5),
        Option("dots", (6.0, 10.0), gloss=0.4, second="darker"),
        Option("stripes", (6.0, 10.0), second="pale"),
    ),
    "skin": _role(
        "leaf",
        Option("noise", (3.0, 6.0)),
        Option("dots", (5.0, 9.0), second="lighter"),
        Option("stripes", (5.0, 9.0)),
    ),
    "fur": _role(
        "fur",
        Option("noise", (4.0, 8.0), gloss=0.05, weight=2.0),
        Option("dots", (6.0, 9.0), gloss=0.05, second="pale"),
        Option("plain", (3.0, 5.0), gloss=0.05),
    ),
    "feather": _role(
        "paint",
        Option("scales", (6.0, 10.0)),
        Option("noise", (3.0, 5.0)),
        Option("stripes", (5.0, 8.0), second="darker"),
    ),
    "cloth": _role(
        "paint",
        Option("fabric", (6.0, 12.0), gloss=0.0, second="other", weight=2.0),
        Option("stripes", (3.0, 6.0), gloss=0.0, second="pale"),
        Option("dots", (4.0, 7.0), gloss=0.0, second="pale"),
        Option("checker", (4.0, 7.0), gloss=0.0, second="pale", weight=0.6),
    ),
    "metal": _role(
        "metal",
        Option("plain", (2.0, 4.0), gloss=0.8, weight=2.0),
        Option("rust", (2.0, 4.0), gloss=0.3),
    ),
    "rubber": _role("dark", Option("plain", (2.0, 4.0), gloss=0.2)),
    "pane": _role("dark", Option("plain", (1.0, 2.0), gloss=0.9, second="lighter")),
    "plaster": _role("pale", Option("plain", (2.0, 4.0)), Option("plaster", (3.0, 5.0))),
    "facade": _role(
        "wall",
        Option("plaster", (0.7, 1.5), "metre", weight=2.0),
        Option("brick", (4.0, 6.0), "metre", weight=1.5),
        Option("planks", (3.0, 5.0), "metre"),
        Option("stone", (1.5, 3.0), "metre"),
    ),
    "roof": _role(
        "roof",
        Option("scales", (3.0, 5.0), "metre"),
        Option("tiles", (2.5, 4.0), "metre"),
        Option("planks", (3.0, 5.0), "metre"),
    ),
    "brick": _role(
        "brick",
        Option("brick", (6.0, 9.0), "metre", second="lighter", weight=2.0),
        Option("stone", (3.0, 5.0), "metre"),
    ),
    "floor": _role(
        "wood",
        Option("planks", (5.0, 9.0), "metre", gloss=0.25, weight=2.0),
        Option("tiles", (2.5, 5.0), "metre", gloss=0.45, second="lighter"),
        Option("checker", (1.5, 3.0), "metre", gloss=0.35, second="lighter", weight=0.7),
        Option("marble", (0.8, 1.6), "metre", gloss=0.5, second="lighter"),
        Option("fabric", (12.0, 20.0), "metre", gloss=0.0, weight=0.7),
    ),
    "wall": _role(
        "wall",
        Option("plaster", (1.0, 2.0), "metre", gloss=0.0, weight=2.5),
        Option("stripes", (3.0, 6.0), "metre", gloss=0.0),
        Option("brick", (8.0, 12.0), "metre", gloss=0.0),
        Option("dots", (4.0, 7.0), "metre", gloss=0.0, second="lighter", weight=0.6),
        Option("planks", (4.0, 8.0), "metre", weight=0.7),
        Option("tiles", (4.0, 7.0), "metre", gloss=0.5, second="lighter", weight=0.5),
    ),
    "rug": _role(
        "paint",
        Option("fabric", (8.0, 14.0), "metre", gloss=0.0, second="other", weight=2.0),
        Option("stripes", (3.0, 6.0), "metre", gloss=0.0, second="other"),
        Option("checker", (3.0, 5.0), "metre", gloss=0.0),
        Option("dots", (4.0, 8.0), "metre", gloss=0.0, second="pale"),
    ),
    "picture": _role(
        "paint",
        Option("noise", (2.0, 4.0), second="other"),
        Option("lettering", (4.0, 7.0), second="darker"),
        Option("marble", (1.5, 3.0), second="other"),
        Option("dots", (3.0, 6.0), second="other"),
    ),
    "lawn": _role(
        "leaf",
        Option("grass", (4.0, 9.0), "metre", gloss=0.0, weight=3.0),
        Option("leaves", (8.0, 13.0), "metre", gloss=0.0),
    ),
    "soil": _role(
        "ground",
        Option("noise", (0.8, 1.6), "metre", gloss=0.0, weight=2.0),
        Option("leaves", (8.0, 13.0), "metre", gloss=0.0),
        Option("grass", (4.0, 8.0), "metre", gloss=0.0),
    ),
    "paving": _role(
        "stone",
        Option("tiles", (1.2, 2.2), "metre", gloss=0.1, second="darker"),
        Option("stone", (1.5, 3.0), "metre", gloss=0.1),
        Option("brick", (5.0, 8.0), "metre", gloss=0.05),
        Option("checker", (0.8, 1.4), "metre", second="lighter", weight=0.6),
    ),
    "asphalt": _role(
        "stone",
        Option("noise", (1.5, 3.0), "metre", gloss=0.05),
        Option("plaster", (1.0, 2.0), "metre", gloss=0.05),
    ),
    "sand": _role(
        "ground",
        Option("noise", (0.7, 1.4), "metre", gloss=0.0),
        Option("plaster", (1.0, 2.0), "metre", gloss=0.0),
    ),
    "daylight": _role("sky", Option("plain", (1.0, 2.0), gloss=0.6, second="lighter")),
    "hill": _role("leaf", Option("noise", (0.05, 0.12), "metre", gloss=0.0)),
}


class MaterialSampler:
    """Samples the textures of one world."""

    def __init__(
        self, palette: Palette, textures: frozenset[str], wanted: frozenset[str], rng: Rng
    ) -> None:
        self._palette = palette
        self._textures = textures
        self._wanted = wanted
        self._draws = rng
        self._given = 0

    def texture(self, role: str, size_m: float, *, prefer_wanted: bool = False) -> Texture:
        """A texture for ``role`` on an object of this size."""
        rng = self._draws.child("look", self._given)
        self._given += 1
        options = [o for o in ROLES[role].options if o.family in self._textures]
        wanted = [o for o in options if o.family in self._wanted]
        option = rng.weighted_choice(*_weighed(wanted if prefer_wanted and wanted else options))
        features = rng.uniform(*option.features)
        scale = features if option.per == "metre" else features / size_m
        base = rng.choice(self._palette.colors(ROLES[role].colors))
        return Texture(
            family=option.family,
            colors=quantise(self._colors(option, base, rng), COLOR_BITS),
            scale=quantise_number(scale),
            seed=rng.random_seed(),
            solid=option.family in SOLID,
            relief=quantise_number(RELIEF.get(option.family, 0.0) / scale, 20),
            gloss=option.gloss,
        )

    def _colors(
        self, option: Option, base: Float64[np.ndarray, "3"], rng: Rng
    ) -> Float64[np.ndarray, "3 3"]:
        base = np.clip(base * (1 + 0.12 * rng.normal(1)) + 0.01 * rng.normal(3), 0.004, 0.92)
        pale = rng.choice(self._palette.colors("pale"))
        other = rng.choice(self._palette.colors("paint"))
        if option.family == "brick":
            return np.stack([base, np.clip(0.7 * base, 0, 1), 0.5 * pale + 0.15 * base])
        second = {
            "darker": base * rng.uniform(0.4, 0.65),
            "lighter": base + (0.9 - base) * rng.uniform(0.2, 0.45),
            "pale": 0.8 * pale + 0.1 * base,
            "other": 0.6 * other + 0.3 * base,
        }[option.second]
        third = 0.3 * base + 0.15 * second
        rows = [second, base] if DOMINANT.get(option.family) == 1 else [base, second]
        return np.clip(np.stack([*rows, third]), 0.004, 0.92)


def _weighed(options: list[Option]) -> tuple[list[Option], list[float]]:
    return options, [option.weight for option in options]


def image_texture(image: PartImage, height_m: float) -> Texture:
    """The image of a part, on an object of this height."""
    mean = linear_from_srgb(image.pixels.reshape(-1, 3).astype(np.float64).mean(0) / 255)
    return Texture(
        family="image",
        colors=quantise(np.stack([mean, 0.6 * mean]), COLOR_BITS),
        scale=quantise_number(image.repeats / height_m, POSE_BITS),
        seed=0,
        gloss=image.gloss,
        image=image.pixels,
        main_color=image.color,
    )


def named_color(texture: Texture) -> str:
    """What captions call the texture; empty for an image of several colours."""
    return texture.main_color if texture.image is not None else color_name(dominant_color(texture))


def dominant_color(texture: Texture) -> Float64[np.ndarray, "3"]:
    """The linear colour that covers most of a texture."""
    return texture.colors[DOMINANT.get(texture.family, 0)]
