"""How much of the light and of the sky reaches a point, from maps of heights toward each.

A map looks along one direction: texel (row, column) holds the height, along that direction, of the
surface nearest to the light. Heights are kept positive, which makes a map an image that the
rasteriser draws: vertices (u/h, v/h, 1/h) have 1/z = h, linear on the image as an orthographic
height is.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from diff4splat.data_prep.synthetic.renderer.cameras import SampleGrid
from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.numerics import clamp, dot
from diff4splat.data_prep.synthetic.renderer.rasterise import blank, rasterise
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import TriangleBuffer
from diff4splat.kernels.jit import inlined, shared

_TURN_X, _TURN_Y = -0.7373688780783197, 0.6754902942615238
"""The golden angle: points of a spiral cover a disc evenly (Vogel 1979)."""
_SEARCH_M = 3.0
"""Blockers up to this far from a surface widen its shadows in full."""


class Chart(NamedTuple):
    """The plane of a height map: world to texels and heights."""

    axes: np.ndarray
    """Rows: along columns, along rows, toward the light."""
    start: np.ndarray
    """(u, v) of the first texel's corner and the height that counts as 0; metres."""
    texel_m: float


def chart_of(
    toward: Float64[np.ndarray, " 3"],
    points: Float64[np.ndarray, "n 3"],
    buffer: TriangleBuffer,
    edge_px: int,
) -> Chart:
    """The plane whose map covers ``points``, but for the outermost hundredth."""
    axes = _axes(toward)
    low, size = np.zeros(2), 1e-3
    if len(points):
        for axis in range(2):
            along = np.sort(_along(axes[axis], points))
            low[axis] = along[len(along) // 100]
            size = max(size, float(along[-1 - len(along) // 100] - low[axis]))
    size = min(1.06 * size + 0.1, 60.0)
    height = _along(axes[2], buffer.positions.reshape(-1, 3))
    lowest = float(height.min()) - 1.0 if len(height) else 0.0
    return Chart(
        axes, np.array([low[0] - 0.03 * size, low[1] - 0.03 * size, lowest]), size / edge_px
    )


def _along(axis: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points[:, 0] * axis[0] + points[:, 1] * axis[1] + points[:, 2] * axis[2]


def _axes(toward: np.ndarray) -> np.ndarray:
    """Three orthogonal unit rows, the last one ``toward``."""
    x, y, z = (float(value) for value in toward)
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = (x / length, y / length, z / length) if length > 0 else (0.0, -1.0, 0.0)
    # The axis that is least along the light is a good start for the other two.
    across = (0.0, -z, y) if abs(x) <= abs(z) else (-y, x, 0.0)
    length = math.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    u = tuple(value / length for value in across)
    v = (y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0])
    return np.array([u, v, (x, y, z)])


class HeightMaps:
    """Maps of every frame along one direction; what is static is drawn once."""

    def __init__(self, chart: Chart, buffer: TriangleBuffer, edge_px: int) -> None:
        self.chart, self._stage = chart, buffer
        middle = np.arange(edge_px) + 0.5
        ones, zeros = np.ones(2), np.zeros(2)
        self._grid = SampleGrid(middle[None], middle, np.zeros(edge_px), ones, zeros, 1)
        self._still = blank(edge_px, edge_px)
        if len(buffer.positions):
            self._draw(0, (0, buffer.static_count), self._still)

    def at(self, frame: int) -> Float64[np.ndarray, "h w"]:
        """Heights toward the light in one frame."""
        if self._stage.static_count == len(self._stage.triangles):
            return self._still[0]
        drawn = self._still[0].copy(), self._still[1].copy()
        self._draw(frame, (self._stage.static_count, len(self._stage.triangles)), drawn)
        return drawn[0]

    def _draw(self, frame: int, part: tuple[int, int], to: tuple[np.ndarray, np.ndarray]) -> None:
        local = np.empty_like(self._stage.rest)
        to_chart(self._stage.positions[frame], self.chart, local)
        rasterise(local, self._stage.triangles, *part, self._grid, 1e-12, *to)


@kernel
def to_chart(positions, chart, local):
    """World positions to vertices of which the rasteriser draws a height map."""
    axes, start = chart.axes, chart.start
    for index in range(len(positions)):
        x, y, z = positions[index, 0], positions[index, 1], positions[index, 2]
        height = x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2] - start[2]
        u = (x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2] - start[0]) / chart.texel_m
        v = (x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2] - start[1]) / chart.texel_m
        local[index, 0], local[index, 1], local[index, 2] = u / height, v / height, 1.0 / height


@inlined
def height_at(heights, u, v):
    """The map's height in texels' coordinates; 0 outside, where nothing is known to be."""
    if not (u >= 0.0 and v >= 0.0 and u < heights.shape[1] and v < heights.shape[0]):
        return 0.0
    return heights[int(v), int(u)]


@inlined
def placed(x, y, z, chart):
    """(u, v) in texels and height of a point."""
    axes, start = chart.axes, chart.start
    u = (dot(x, y, z, axes[0, 0], axes[0, 1], axes[0, 2]) - start[0]) / chart.texel_m
    v = (dot(x, y, z, axes[1, 0], axes[1, 1], axes[1, 2]) - start[1]) / chart.texel_m
    return u, v, dot(x, y, z, axes[2, 0], axes[2, 1], axes[2, 2]) - start[2]


@shared
def lit(x, y, z, normal, heights, chart, softness, begin_x, begin_y):
    """Share of the main light that reaches a point, 0 to 1 (Fernando 2005).

    First how far above the surface blockers are, on a disc as wide as the widest half-shadow; then
    the share of lit points on a disc as wide as that distance makes the half-shadow. Heights are
    compared with the plane of the surface, moved out along its normal, so that it never shades
    itself. ``begin`` turns the pattern.
    """
    axes, texel = chart.axes, chart.texel_m
    nu = dot(normal[0], normal[1], normal[2], axes[0, 0], axes[0, 1], axes[0, 2])
    nv = dot(normal[0], normal[1], normal[2], axes[1, 0], axes[1, 1], axes[1, 2])
    nh = dot(normal[0], normal[1], normal[2], axes[2, 0], axes[2, 1], axes[2, 2])
    if nh <= 0.0:
        return 0.0
    out = 1.2 * texel
    u, v, height = placed(x + normal[0] * out, y + normal[1] * out, z + normal[2] * out, chart)
    steep = max(nh, 0.15)
    rise_u, rise_v = -nu / steep * texel, -nv / steep * texel
    bias = 0.4 * texel / steep
    search = clamp(softness * _SEARCH_M / texel, 1.5, 24.0)
    dx, dy = begin_x, begin_y
    blockers, distance = 0, 0.0
    for tap in range(8):
        radius = search * math.sqrt((tap + 0.5) / 8)
        du, dv = dx * radius, dy * radius
        above = height_at(heights, u + du, v + dv) - (height + rise_u * du + rise_v * dv)
        if above > bias:
            blockers += 1
            distance += above
        dx, dy = dx * _TURN_X - dy * _TURN_Y, dx * _TURN_Y + dy * _TURN_X
    if blockers == 0:
        return 1.0
    width = clamp(softness * (distance / blockers) / texel, 0.8, search)
    open_taps = 0
    for tap in range(12):
        radius = width * math.sqrt((tap + 0.5) / 12)
        du, dv = dx * radius, dy * radius
        above = height_at(heights, u + du, v + dv) - (height + rise_u * du + rise_v * dv)
        if above <= bias:
            open_taps += 1
        dx, dy = dx * _TURN_X - dy * _TURN_Y, dx * _TURN_Y + dy * _TURN_X
    return open_taps / 12.0


@shared
def open_sky(x, y, z, normal, heights, chart, reach_m, begin_x, begin_y):
    """Share of the light from all around that reaches a point, 0 to 1.

    The map from above is a landscape; in six directions the steepest rise of three hides sky, and
    directions count as the surface faces them (horizon mapping, Max 1988).
    """
    axes, texel = chart.axes, chart.texel_m
    nu = dot(normal[0], normal[1], normal[2], axes[0, 0], axes[0, 1], axes[0, 2])
    nv = dot(normal[0], normal[1], normal[2], axes[1, 0], axes[1, 1], axes[1, 2])
    up = max(dot(normal[0], normal[1], normal[2], axes[2, 0], axes[2, 1], axes[2, 2]), 0.0)
    out = 1.5 * texel
    u, v, height = placed(x + normal[0] * out, y + normal[1] * out, z + normal[2] * out, chart)
    height += 0.5 * texel
    dx, dy = begin_x, begin_y
    total, hidden = 0.0, 0.0
    for _ in range(6):
        steepest, radius = 0.0, reach_m * 0.07
        for _ in range(3):
            du, dv = dx * radius / texel, dy * radius / texel
            rise = (height_at(heights, u + du, v + dv) - height) / radius
            steepest = max(steepest, rise)
            radius *= 3.0
        weight = 0.15 + up + max(nu * dx + nv * dy, 0.0)
        total += weight
        hidden += weight * steepest * steepest / (1.0 + steepest * steepest)
        # A sixth of a turn.
        dx, dy = 0.5 * dx - 0.8660254037844386 * dy, 0.8660254037844386 * dx + 0.5 * dy
    return 1.0 - 0.92 * hidden / total
