"""The colour of a primitive along a ray: 0.5 + Σ_k sh_k Y_k(direction).

Sixteen coefficients of a channel lie side by side, so one channel is one product of lanes.
"""

from typing import NamedTuple

import numpy as np

from diff4splat.kernels.addresses import address, double_at, float_at, lanes_at
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES, total
from diff4splat.kernels.simd_memory import aligned_floats
from diff4splat.render.raster.projection.harmonics import evaluate as evaluate_harmonics
from diff4splat.render.trace.tables import CENTER, MEAN, MOVING_COLUMNS, VELOCITY, Doubles, Floats

PLAIN_COLUMNS = 4
"""Columns of a table of plain colours."""


class ShWorkspace(NamedTuple):
    """Memory for the harmonics in one direction."""

    basis: Floats
    """Sixteen lanes, zeros behind the bands there are."""
    values: Doubles
    slopes: Doubles
    """Gradients of the values in the direction (16 × 3)."""


class ColorTables(NamedTuple):
    """Addresses of the arrays that colours depend on."""

    colors: int
    table: int
    columns: int
    origins: int
    directions: int
    times: int
    basis: int
    bands: int
    toward_mean: bool
    workspace: ShWorkspace


@inlined
def make_sh_workspace():
    """Memory for one thread."""
    basis = aligned_floats(LANES)
    basis[:] = 0
    return ShWorkspace(basis, np.zeros(16), np.zeros((16, 3)))


@inlined
def color_tables(inputs, workspace):
    """Addresses of the colours and rays of ``inputs``."""
    scene, rays = inputs.scene, inputs.rays
    return ColorTables(
        address(scene.colors),
        address(scene.primitives),
        scene.primitives.shape[1],
        address(rays.origins),
        address(rays.directions),
        address(rays.times),
        address(workspace.basis),
        inputs.bands,
        inputs.rules.toward_mean and inputs.bands > 1,
        workspace,
    )


@inlined
def evaluate_sh(tables, i, ray):
    """Evaluate the harmonics of primitive ``i`` along ``ray``."""
    if tables.bands > 1:
        direction = (
            mean_direction(tables, i, ray)
            if tables.toward_mean
            else triple_at(tables.directions, ray)
        )
        values = tables.workspace.values
        evaluate_harmonics(
            direction, (0.0, 0.0, 0.0), tables.bands, values, tables.workspace.slopes
        )
        for k in range(tables.bands):
            tables.workspace.basis[k] = values[k]


@inlined
def mean_direction(tables, i, ray):
    """From the origin of a ray to a mean at the ray's time; not of unit length."""
    x, y, z = triple_at(tables.origins, ray)
    row = tables.table + 8 * tables.columns * i
    x, y, z = double_at(row, MEAN) - x, double_at(row, MEAN + 1) - y, double_at(row, MEAN + 2) - z
    if tables.columns == MOVING_COLUMNS:
        since = np.float64(float_at(tables.times, ray)) - double_at(row, CENTER)
        x += since * double_at(row, VELOCITY)
        y += since * double_at(row, VELOCITY + 1)
        z += since * double_at(row, VELOCITY + 2)
    return x, y, z


@inlined
def triple_at(place, row):
    """Three float32 of a row, in float64."""
    return (
        np.float64(float_at(place, 3 * row)),
        np.float64(float_at(place, 3 * row + 1)),
        np.float64(float_at(place, 3 * row + 2)),
    )


@inlined
def color(tables, i, channel):
    """One channel of a primitive before it is held above 0."""
    if tables.bands == 1:
        return np.float64(float_at(tables.colors, i * PLAIN_COLUMNS + channel))
    row = lanes_at(tables.colors, (i * 3 + channel) * LANES)
    return 0.5 + np.float64(total(row * lanes_at(tables.basis, 0)))
