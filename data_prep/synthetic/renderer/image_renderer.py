"""Renders images: light and shadow once per frame, colours once per view.

Axes: ``t`` frames, ``v`` vertices.
"""

import numpy as np
from jaxtyping import Float64, UInt8

from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera, sample_grid
from diff4splat.data_prep.synthetic.renderer.ground_truth.maps import GroundTruth, camera_vertices
from diff4splat.data_prep.synthetic.renderer.rasterise import NEAR_M, blank, rasterise
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.shading.image_colors import ShadedView, shade
from diff4splat.data_prep.synthetic.renderer.shading.normals import vertex_normals
from diff4splat.data_prep.synthetic.renderer.shading.reflection import Shade
from diff4splat.data_prep.synthetic.renderer.shading.shadows import HeightMaps, chart_of
from diff4splat.data_prep.synthetic.renderer.shading.skies import lighting_of
from diff4splat.data_prep.synthetic.renderer.shading.surface_point import Surfaces
from diff4splat.data_prep.synthetic.renderer.shading.tone import byte_thresholds
from diff4splat.data_prep.synthetic.renderer.textures.materials import materials_of
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import TriangleBuffer
from diff4splat.data_prep.synthetic.world import World

_UP = np.array([0.0, -1.0, 0.0])
_REACH = 0.10
"""Reach of ambient occlusion, as a share of the visible extent."""

_TARGET_MEAN = 0.42
"""Target mean of the exposure."""


class Renderer:
    """Renders any frame of a world."""

    def __init__(
        self,
        world: World,
        buffer: TriangleBuffer,
        seen: Float64[np.ndarray, "n 3"],
        settings: DrawSettings,
    ) -> None:
        self._buffer, self._settings, self._seen = buffer, settings, seen
        self._materials, self._lighting = materials_of(buffer), lighting_of(world)
        edge, half = settings.shadow_px, max(settings.shadow_px // 2, 1)
        self._sun = HeightMaps(chart_of(world.light.toward, seen, buffer, edge), buffer, edge)
        self._above = HeightMaps(chart_of(_UP, seen, buffer, half), buffer, half)
        self._reach_m = min(max(_REACH * half * self._above.chart.texel_m, 0.2), 2.0)

    def auto_expose(self, frame: int, lens: RenderCamera) -> None:
        """Set the exposure so that this frame is neither dark nor overexposed.

        The light alone is not enough, since the walls of a room may block it.
        """
        mean = int(self.render(frame, [lens])[0].sum(dtype=np.int64))
        mean_share = max(mean / (lens.height * lens.width * 3 * 255), 1e-3)
        factor = min(max(_TARGET_MEAN / mean_share, 0.85), 2.2)
        self._lighting = self._lighting._replace(exposure=self._lighting.exposure * factor)

    def of(self, world: World, buffer: TriangleBuffer) -> "Renderer":
        """Another world in the same exposure, with shadows of the same resolution."""
        other = Renderer(world, buffer, self._seen, self._settings)
        other._lighting = other._lighting._replace(exposure=self._lighting.exposure)
        return other

    def render(self, frame: int, lenses: list[RenderCamera]) -> list[UInt8[np.ndarray, "h w 3"]]:
        """The image of every view at one frame."""
        buffer = self._buffer
        normals = np.zeros_like(buffer.rest)
        vertex_normals(buffer.positions[frame], buffer.triangles, normals)
        shades = Shade(
            self._sun.at(frame), self._sun.chart,
            self._above.at(frame), self._above.chart, self._reach_m,
        )  # fmt: skip
        return [self._render_view(frame, lens, normals, shades) for lens in lenses]

    def _render_view(
        self, frame: int, lens: RenderCamera, normals: Float64[np.ndarray, "v 3"], shades: Shade
    ) -> UInt8[np.ndarray, "h w 3"]:
        buffer, grid = self._buffer, sample_grid(lens, self._settings.samples_per_side)
        local = camera_vertices(buffer, frame, lens)
        closest, found = blank(len(grid.y), grid.x.shape[1])
        rasterise(local, buffer.triangles, 0, len(buffer.triangles), grid, NEAR_M, closest, found)
        surfaces = Surfaces(
            buffer.positions[frame], local, normals, buffer.rest, buffer.uv, buffer.triangles,
            buffer.owners,
        )  # fmt: skip
        image = np.zeros((lens.height, lens.width, 3), np.uint8)
        view = ShadedView(lens, surfaces, self._materials, self._lighting, shades)
        shade(found, grid, view, byte_thresholds(), image)
        return image


def visible_world_points(
    truths: list[list[GroundTruth]], lenses: list[list[RenderCamera]]
) -> Float64[np.ndarray, "n 3"]:
    """World positions of every second pixel of every second row, over all views and frames."""
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
