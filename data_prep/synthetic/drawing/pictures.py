"""Pictures of a stage: light and shadow once per frame, colours once per view.

Axes: ``t`` frames, ``v`` vertices.
"""

import numpy as np
from jaxtyping import Float64, UInt8

from diff4splat.data_prep.synthetic.drawing.gather import Stage
from diff4splat.data_prep.synthetic.drawing.lenses import Lens, grid_of
from diff4splat.data_prep.synthetic.drawing.normals import vertex_normals
from diff4splat.data_prep.synthetic.drawing.rasterise import NEAR_M, blank, rasterise
from diff4splat.data_prep.synthetic.drawing.settings import DrawSettings
from diff4splat.data_prep.synthetic.drawing.shading import Shade, Surfaces, shade
from diff4splat.data_prep.synthetic.drawing.shadows import HeightMaps, chart_of
from diff4splat.data_prep.synthetic.drawing.skies import lighting_of
from diff4splat.data_prep.synthetic.drawing.textures import materials_of
from diff4splat.data_prep.synthetic.drawing.tone import byte_thresholds
from diff4splat.data_prep.synthetic.drawing.truth import Truth, seen_from
from diff4splat.data_prep.synthetic.world import World

_UP = np.array([0.0, -1.0, 0.0])
_REACH = 0.10
"""How far sky is hidden, as a share of what is seen."""

_MIDDLE = 0.42
"""Mean of a picture that is well exposed."""


class Painter:
    """Draws any frame of a stage."""

    def __init__(
        self, world: World, stage: Stage, seen: Float64[np.ndarray, "n 3"], settings: DrawSettings
    ) -> None:
        self._stage, self._settings = stage, settings
        self._materials, self._lighting = materials_of(stage), lighting_of(world)
        edge, half = settings.shadow_px, max(settings.shadow_px // 2, 1)
        self._sun = HeightMaps(chart_of(world.light.toward, seen, stage, edge), stage, edge)
        self._above = HeightMaps(chart_of(_UP, seen, stage, half), stage, half)
        self._reach_m = min(max(_REACH * half * self._above.chart.texel_m, 0.2), 2.0)

    def expose(self, frame: int, lens: Lens) -> None:
        """Open or close the shutter so that this frame is neither dark nor blown out.

        The light alone does not say whether a room's walls keep it out.
        """
        mean = int(self.paint(frame, [lens])[0].sum(dtype=np.int64))
        mean_share = max(mean / (lens.height * lens.width * 3 * 255), 1e-3)
        factor = min(max(_MIDDLE / mean_share, 0.85), 2.2)
        self._lighting = self._lighting._replace(exposure=self._lighting.exposure * factor)

    def paint(self, frame: int, lenses: list[Lens]) -> list[UInt8[np.ndarray, "h w 3"]]:
        """One frame in every view."""
        stage = self._stage
        normals = np.zeros_like(stage.rest)
        vertex_normals(stage.positions[frame], stage.triangles, normals)
        shades = Shade(
            self._sun.at(frame), self._sun.chart,
            self._above.at(frame), self._above.chart, self._reach_m,
        )  # fmt: skip
        return [self._paint(frame, lens, normals, shades) for lens in lenses]

    def _paint(
        self, frame: int, lens: Lens, normals: Float64[np.ndarray, "v 3"], shades: Shade
    ) -> UInt8[np.ndarray, "h w 3"]:
        stage, grid = self._stage, grid_of(lens, self._settings.samples_per_side)
        local = seen_from(stage, frame, lens)
        closest, found = blank(len(grid.y), grid.x.shape[1])
        rasterise(local, stage.triangles, 0, len(stage.triangles), grid, NEAR_M, closest, found)
        surfaces = Surfaces(
            stage.positions[frame], local, normals, stage.rest, stage.uv, stage.triangles,
            stage.owners,
        )  # fmt: skip
        picture = np.zeros((lens.height, lens.width, 3), np.uint8)
        shade(
            found, grid, lens, surfaces, self._materials, self._lighting, shades,
            byte_thresholds(), picture,
        )  # fmt: skip
        return picture


def points_seen(truths: list[list[Truth]], lenses: list[list[Lens]]) -> Float64[np.ndarray, "n 3"]:
    """World positions of every second pixel of every second row in all views and frames."""
    parts = [np.zeros((0, 3))]
    for row, cameras in zip(truths, lenses, strict=True):
        for truth, lens in zip(row, cameras, strict=True):
            depth = truth.depth[::2, ::2].astype(np.float64)
            x = (np.arange(0, lens.width, 2) + 0.5 - lens.center[0]) / lens.focal[0]
            y = (np.arange(0, lens.height, 2)[:, None] + 0.5 - lens.center[1]) / lens.focal[1]
            turn = lens.rotation
            world = np.stack(
                [
                    depth * (turn[axis, 0] * x + turn[axis, 1] * y + turn[axis, 2])
                    + lens.position[axis]
                    for axis in range(3)
                ],
                -1,
            )
            parts.append(world[depth > 0])
    return np.concatenate(parts)
