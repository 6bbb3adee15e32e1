"""Kernel: gradients of outputs to those of the rays, and to sums per primitive.

Per ray, back to front, with B the light from behind a hit times its gradient:

    ∂/∂ln α = (T worth - B / (1 - α)) α    worth = rgb · ∂rgb + τ ∂Στw + ∂Σw

Rays of a part of packets are done one after another and every primitive of the part has one row, so
no sum depends on threads.
"""

from typing import NamedTuple

import numpy as np

from diff4splat.kernels.addresses import (
    address,
    double_at,
    float_at,
    int_at,
    put_double,
    put_lanes,
    word_at,
)
from diff4splat.kernels.jit import inlined
from diff4splat.kernels.simd16 import LANES, fill
from diff4splat.kernels.simd_memory import aligned_floats
from diff4splat.render.trace.jit import kernel
from diff4splat.render.trace.shading.gradient_sums import COLUMNS, LOBES, TO_RAY
from diff4splat.render.trace.shading.intersect_backward import intersect_backward
from diff4splat.render.trace.shading.sh_color import (
    color,
    color_tables,
    evaluate_sh,
    make_sh_workspace,
    triple_at,
)
from diff4splat.render.trace.shading.sh_color_backward import (
    evaluate_sh_backward,
    lobes_backward,
    mean_direction_backward,
    plain_backward,
)
from diff4splat.render.trace.shading.shade import (
    DISTANCE,
    LIGHT,
    MEDIAN,
    OUTPUT_COLUMNS,
    RGB,
    WEIGHT,
)
from diff4splat.render.trace.traversal.intersect import scratch_addresses
from diff4splat.render.trace.traversal.traverse import initial_scratch, traverse_in_parts

_ROWS = 1024


class _Workspace(NamedTuple):
    """Addresses of the arrays of one thread."""

    where: int
    """The row of every primitive, or -1."""
    sums: int
    lobes: int
    lights: int
    """The light in front of every hit of a ray."""
    ray_row: int
    basis_grad: int
    output_grads: int


@kernel
def shade_backward(first, last, inputs, output_grads, where, listed, ray_grads):
    """Gradients of the rays of packets ``first`` to ``last``, and sums of the primitives they hit.

    ``where`` (-1 everywhere, and so again afterwards) and ``listed`` have room for all primitives.
    Returns the primitives, their sums, and the sums of their harmonics.
    """
    scratch, workspace, count, curved = initial_scratch(), make_sh_workspace(), 0, inputs.bands > 1
    tables = color_tables(inputs, workspace)
    sums, lobes = np.zeros((_ROWS, COLUMNS)), np.zeros((_ROWS, LOBES), np.float32)
    lights, basis_grad, ray_row = np.empty(_ROWS), aligned_floats(LANES), np.empty(TO_RAY)
    rays = inputs.rays
    for packet in range(first, last):
        place, stop = rays.starts[packet], rays.starts[packet + 1]
        while place < stop:
            end, scratch = traverse_in_parts(inputs, place, stop, scratch)
            at = scratch_addresses(scratch, end - place)
            count = _list(at, end - place, where, listed, count)
            sums = _grown(sums, count)
            lobes = _grown(lobes, count if curved else 0)
            if at.room > len(lights):
                lights = np.empty(at.room)
            work = _Workspace(
                address(where), address(sums), address(lobes), address(lights), address(ray_row),
                address(basis_grad), address(output_grads),
            )  # fmt: skip
            for lane in range(end - place):
                ray = rays.order[place + lane]
                ray_row[:] = 0.0
                _ray_backward(at, tables, inputs.rules, work, lane, ray)
                for column in range(TO_RAY):
                    ray_grads[ray, column] = ray_row[column]
            place = end
    for row in range(count):
        where[listed[row]] = -1
    return listed[:count].copy(), sums[:count], lobes[: count if curved else 0]


@inlined
def _list(at, rays, where, listed, count):
    """Give every primitive that is hit for the first time the next row."""
    for lane in range(rays):
        first = lane * at.room
        for place in range(first, first + word_at(at.counts, lane)):
            i = int_at(at.members, int_at(at.ranks, place))
            if where[i] < 0:
                where[i], listed[count] = count, i
                count += 1
    return count


@inlined
def _grown(rows, count):
    """Room for at least ``count`` rows, new ones zero."""
    if count <= len(rows):
        return rows
    larger = np.zeros((2 * count, rows.shape[1]), rows.dtype)
    for row in range(len(rows)):
        for column in range(rows.shape[1]):
            larger[row, column] = rows[row, column]
    return larger


@inlined
def _ray_backward(at, tables, rules, work, lane, ray):
    """One ray, back to front."""
    first, stop = lane * at.room, lane * at.room + word_at(at.counts, lane)
    light = _lights(at, first, stop, work.lights)
    given = work.output_grads + 4 * OUTPUT_COLUMNS * ray
    color_grad, far_grad = triple_at(given + 4 * RGB, 0), np.float64(float_at(given, DISTANCE))
    weight_grad, median_grad = float_at(given, WEIGHT), float_at(given, MEDIAN)
    beyond, along = light * float_at(given, LIGHT), fill(0.0)
    for place in range(stop - 1, first - 1, -1):
        alpha = np.float64(float_at(at.alphas, place))
        i = np.int64(int_at(at.members, int_at(at.ranks, place)))
        row = np.int64(int_at(work.where, i))
        if place == stop - 1 or tables.toward_mean:
            evaluate_sh(tables, i, ray)
        after, light = light, double_at(work.lights, place - first)
        worth, pulls = _worth(tables, i, color_grad, alpha * light)
        worth += far_grad * float_at(at.distances, place) + weight_grad
        e = (light * worth - beyond / (1 - alpha)) * alpha
        if float_at(at.alphas, place) >= np.float32(rules.alpha_max):
            e = 0.0
        beyond += alpha * light * worth
        f = far_grad * alpha * light + (median_grad if light > 0.5 >= after else 0.0)
        sums = work.sums + 8 * COLUMNS * row
        intersect_backward(tables, rules.quartic, i, ray, (e, f), sums, work.ray_row)
        if tables.bands == 1:
            plain_backward(sums, pulls)
        else:
            direction_grad = lobes_backward(tables, i, work.lobes + 4 * LOBES * row, pulls)
            along = along + direction_grad
            if tables.toward_mean:
                put_lanes(work.basis_grad, 0, direction_grad)
                mean_direction_backward(tables, i, ray, work.basis_grad, sums, work.ray_row)
    if tables.bands > 1 and not tables.toward_mean and stop > first:
        put_lanes(work.basis_grad, 0, along)
        evaluate_sh_backward(tables, work.basis_grad, work.ray_row)


@inlined
def _lights(at, first, stop, lights):
    """The light in front of every hit; returns the light after the last."""
    light = 1.0
    for place in range(first, stop):
        put_double(lights, place - first, light)
        light -= np.float64(float_at(at.alphas, place)) * light
    return light


@inlined
def _worth(tables, i, color_grad, weight):
    """Colour times its gradient, and the gradient of the colour before it is held above 0."""
    red, green, blue = color(tables, i, 0), color(tables, i, 1), color(tables, i, 2)
    worth = color_grad[0] * max(red, 0.0) + color_grad[1] * max(green, 0.0)
    return worth + color_grad[2] * max(blue, 0.0), (
        weight * color_grad[0] if red >= 0 else 0.0,
        weight * color_grad[1] if green >= 0 else 0.0,
        weight * color_grad[2] if blue >= 0 else 0.0,
    )
