"""The colour that captions call a mesh by: of most of its surface, if there is one."""

import numpy as np

from diff4splat.captions.colors import COLOR_NAMES, color_numbers
from diff4splat.captions.srgb import linear_from_srgb
from diff4splat.data_prep.synthetic.meshes.palette import TexturedPart, triangle_areas

MAIN_COLOR_SHARE = 0.5
"""Of the surface."""


def main_color(parts: list[TexturedPart]) -> str:
    """Name of the colour at the middles of triangles, by area; empty for several colours."""
    weights = np.concatenate([triangle_areas(part.vertices, part.triangles) for part in parts])
    pixels = np.concatenate([_at_middles(part) for part in parts]).astype(np.float64) / 255
    found = np.bincount(color_numbers(linear_from_srgb(pixels)), weights, len(COLOR_NAMES))
    most = int(found.argmax())
    return COLOR_NAMES[most] if found[most] >= MAIN_COLOR_SHARE * weights.sum() > 0 else ""


def _at_middles(part: TexturedPart) -> np.ndarray:
    """SRGB bytes of the texel under each triangle's middle."""
    side = len(part.image)
    uv = part.uv[part.triangles].astype(np.float64).mean(1)
    columns, rows = (np.floor(uv * side).astype(np.int64) % side).T
    return part.image[rows, columns]
