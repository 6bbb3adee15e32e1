"""Hand-chosen palettes: what the paints, woods, stones and leaves of one world look like together.

Written in sRGB as people mix them, turned into linear light. Every world draws all its colours from
one palette, which is what makes it look like one place. ``paint`` are the colours of artefacts;
every other list is a material.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float64

from diff4splat.captions.colors import linear_from_hex

Color = Float64[np.ndarray, "3"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Palette:
    """Colours by material, as hexadecimal sRGB words."""

    paint: str
    wood: str
    stone: str
    leaf: str
    wall: str
    ground: str
    roof: str = "8a4a38 6d4438 54555c 7a5a44"
    fur: str = "7a5236 3c2f28 b99467 8c8278 d8cbb4 5a4636"
    brick: str = "93523f 7d4a3c a86b4e 8f7760"
    metal: str = "8a8d90 55585c a79b86"
    dark: str = "24252a 2f2b2a"
    pale: str = "e6e1d6 d9d6cf f0ece2"
    sky: str = "b9d2e6 d6e4ee f2e6d0 a9c4dc"

    def colors(self, kind: str) -> tuple[Color, ...]:
        """Linear RGB of one material."""
        return _linear(getattr(self, kind))


@cache
def _linear(words: str) -> tuple[Color, ...]:
    return tuple(linear_from_hex(word) for word in words.split())


PALETTES: dict[str, Palette] = {
    "nursery": Palette(
        paint="b8413a d99a3d 3f6f9e 5d8f57 e3c46a 7d5a8c",
        wood="c49a66 a8794a",
        stone="a59f94 8f8b84",
        leaf="5c7a3c 6f8a44",
        wall="e3dac6 cfd8d6",
        ground="b08a5c 9a7850",
    ),
    "harbour": Palette(
        paint="2f4f6b a34a3c d8d3c4 4c7a86 c98f4a 39424e",
        wood="7f6a55 93785a",
        stone="7d8288 6a6e74",
        leaf="4f6a4a 64764e",
        wall="b9c2c6 8fa3ad",
        ground="8b8478 746f66",
    ),
    "orchard": Palette(
        paint="a8352c 6b8e3a d9b44a 8c4a2f e0d6b8 486b3c",
        wood="8c6239 74502f",
        stone="9a917f 857d6e",
        leaf="56752f 6d8a35 47652c",
        wall="d9cba8 c2b48e",
        ground="6a7a3a 7c7f42",
    ),
    "desert": Palette(
        paint="c2703d 8e3f2e d9a066 5f7f7a 3f5a66 e3c9a0",
        wood="94704c a5835a",
        stone="b59a78 a38a6c c4ab88",
        leaf="7c8052 66733f",
        wall="d8b58a c99f74",
        ground="c9a676 b8956a",
    ),
    "nordic": Palette(
        paint="8fa7ad c9c3b6 b5654a 4f5f68 d7b98a 7a8f7a",
        wood="d2b48a bf9d70",
        stone="b3b5b4 9da0a0",
        leaf="5f7a58 74886a",
        wall="e8e6e0 d3d8da",
        ground="c7b08c b49c78",
    ),
    "autumn": Palette(
        paint="9c4a22 c77f2c 6f2f24 8a7a3a d2b070 4a4a34",
        wood="6a4a30 80593a",
        stone="857c70 726a60",
        leaf="a8641f b9842c 8a4a20 7a7030",
        wall="cdb694 b39a78",
        ground="7d5e36 8c6c3e",
    ),
    "workshop": Palette(
        paint="4a6a52 b3552f 33546f d0a83c 8a8a86 5a3f36",
        wood="9c7446 876138",
        stone="8c8c8a 777777",
        leaf="4d6b3a 5f7a48",
        wall="c4c0b4 a8aca6",
        ground="86847e 9a968c",
    ),
    "riviera": Palette(
        paint="d9694f 2f7f8c e8c15a f0e2cf 6fa58c b0485a",
        wood="b08a5f 9a744c",
        stone="d0c3a8 beb298",
        leaf="5f8048 7a9450",
        wall="e8cfa8 e0b48c d99f84",
        ground="c4b594 b3a484",
    ),
    "slate": Palette(
        paint="5a6472 8c3f3f b0b4b8 3a4a5c 7a6a5a c2a060",
        wood="5f5046 72604f",
        stone="5c6066 6d7278 4c5056",
        leaf="455c42 56694c",
        wall="9aa0a6 848a92",
        ground="6a6c6e 5c5e60",
    ),
    "tea_house": Palette(
        paint="7a2f2a 3f5a48 c7a36a 2f2f3a 98744c d8cdb4",
        wood="5a3a26 6e4a30 8a6038",
        stone="8f8a7e 7a766c",
        leaf="3f6038 547444",
        wall="d8cbb0 c4b494",
        ground="a58a5c 937a50",
    ),
    "candy": Palette(
        paint="d47f8c 7fb0b8 e6c77a a48cc0 94b87a e8a07a",
        wood="cfa878 b8905f",
        stone="bdb6ac a8a298",
        leaf="6f9a58 86ab60",
        wall="efe0d6 d8e3e0",
        ground="c2a47c b09268",
    ),
    "moor": Palette(
        paint="6a4a5a 4a5a3a 8f7a4a a89a8a 3f4a54 7a3f34",
        wood="6d5c4c 5a4a3c",
        stone="787870 66665f 8a8a80",
        leaf="5a6438 6f6f42 4a5a3a",
        wall="b3ac9c 9a9488",
        ground="6f6a44 7d744c",
    ),
    "lagoon": Palette(
        paint="e08a4a 2f6f8c d8c85a a8466a 5fa08c e6dcc4",
        wood="7a6a54 8a785e",
        stone="8a9088 77807a 9aa096",
        leaf="3f7a5a 5a8f5a 4a6f4a",
        wall="c4cfc6 a8bab4",
        ground="c2b48c b0a27c",
    ),
}
