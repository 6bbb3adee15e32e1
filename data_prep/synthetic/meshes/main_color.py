"""The colour that captions call a mesh by: of most of its surface, if there is one."""

import numpy as np

from diff4splat.captions.colors import linear_from_srgb, main_color_name
from diff4splat.data_prep.synthetic.meshes.palette import TexturedPart, triangle_areas


def main_color(parts: list[TexturedPart]) -> str:
    """Name of the colour at the middles of triangles, by area; empty for several colours."""
    weights = np.concatenate([triangle_areas(part.vertices, part.triangles) for part in parts])
    pixels = np.concatenate([_at_middles(part) for part in parts]).astype(np.float64) / 255
    return main_color_name(linear_from_srgb(pixels), weights)


def _at_middles(part: TexturedPart) -> np.ndarray:
    """SRGB bytes of the texel under each triangle's middle."""
    side = len(part.image)
    uv = part.uv[part.triangles].astype(np.float64).mean(1)
    columns, rows = (np.floor(uv * side).astype(np.int64) % side).T
    return part.image[rows, columns]
