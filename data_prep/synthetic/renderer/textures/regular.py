"""Textures that people make: regular, then worn by noise.

Every function takes a point and the footprint of a sample, both in features, and a seed. It returns
(share of the second colour, share of the third, brightness, height from 0 to 1).
"""

import math

from diff4splat.data_prep.synthetic.renderer.numerics import clamp, clamped, fading, step, wave
from diff4splat.data_prep.synthetic.renderer.textures.noise import flat_octaves, fraction, hashed
from diff4splat.kernels.jit import inlined, shared


@inlined
def _wear(p, q, r, footprint, seed):
    return flat_octaves(0.6 * p + 0.7 * r, 0.6 * q + 0.4 * r, 0.6 * footprint, seed, 7)


@inlined
def _block(p, q, wide, shift, joint, footprint, seed):
    """Blocks in rows, every second one shifted: (inside, hash, distance to the joint)."""
    p, q = clamped(p), clamped(q)
    row = math.floor(q)
    x = p / wide + shift * (row - 2.0 * math.floor(row * 0.5))
    column = math.floor(x)
    across = (0.5 - abs(x - column - 0.5)) * wide
    along = 0.5 - abs(q - row - 0.5)
    edge = min(across, along) - joint
    return step(edge, footprint + 0.02), hashed(int(column), int(row), seed), edge


@shared
def checker(p, q, r, footprint, seed):
    """Fields of two colours, each with its own cast."""
    p, q = clamped(p), clamped(q)
    column, row = math.floor(p), math.floor(q)
    near_x = 0.5 - abs(p - column - 0.5)
    near_y = 0.5 - abs(q - row - 0.5)
    sure = (2.0 * step(near_x, footprint) - 1.0) * (2.0 * step(near_y, footprint) - 1.0)
    odd = (int(column) + int(row)) & 1
    share = 0.5 + (odd - 0.5) * sure * fading(1.0, footprint)
    worn = _wear(p, q, r, footprint, seed)
    tone = (fraction(hashed(int(column), int(row), seed), 9) - 0.5) * fading(1.0, footprint)
    return (
        clamp(share + 0.03 * worn, 0.0, 1.0),
        0.0,
        1.0 + 0.08 * tone + 0.05 * worn,
        0.5 + 0.05 * worn,
    )


@shared
def stripes(p, q, r, footprint, seed):
    """Stripes across p of several widths, painted by hand."""
    worn = _wear(p, q, r, footprint, seed)
    x = clamped(p + 0.02 * worn)
    column = math.floor(x)
    part = x - column
    share = 0.42 + 0.26 * fraction(hashed(column, 1, seed), 5)
    inside = step(part - 0.5 * (1.0 - share), footprint) * step(
        0.5 * (1.0 + share) - part, footprint
    )
    inside = 0.55 + (inside - 0.55) * fading(0.7, footprint)
    thin = step(0.035 - abs(part - 0.02), footprint) * fading(0.3, footprint)
    return inside, 0.8 * thin, 1.0 + 0.06 * worn, 0.5 + 0.2 * inside + 0.03 * worn


@shared
def dots(p, q, r, footprint, seed):
    """Round spots, in rows set off by half, of two sizes and two colours."""
    q = clamped(q)
    row = math.floor(q)
    x = clamped(p + 0.5 * (row - 2.0 * math.floor(0.5 * row)))
    column = math.floor(x)
    bits = hashed(int(column), int(row), seed)
    radius = 0.22 + 0.14 * fraction(bits, 7)
    dx, dy = x - column - 0.5, q - row - 0.5
    inside = step(radius - math.sqrt(dx * dx + dy * dy), footprint)
    inside = 0.26 + (inside - 0.26) * fading(0.8, footprint)
    other = 1.0 if fraction(bits, 30) < 0.3 else 0.0
    worn = _wear(p, q, r, footprint, seed)
    return inside * (1.0 - other), inside * other, 1.0 + 0.055 * worn, 0.5 + 0.3 * inside


@shared
def brick(p, q, r, footprint, seed):
    """Bricks (first and second colour) in mortar (the third), 1 : 2.6."""
    worn = flat_octaves(1.7 * p, 1.7 * q, 1.7 * footprint, seed, 6)
    inside, bits, edge = _block(
        p + 0.015 * worn, q + 0.012 * worn, 2.6, 0.5, 0.055, footprint, seed
    )
    inside = 0.84 + (inside - 0.84) * fading(1.0, footprint)
    seen = fading(1.5, footprint)
    tone, other = 0.5 + (fraction(bits, 6) - 0.5) * seen, 0.55 + (fraction(bits, 26) - 0.55) * seen
    light = (0.78 + 0.38 * tone) * (1.0 + 0.10 * worn)
    share = clamp(other * other * 0.9 + 0.09 * worn, 0.0, 1.0)
    round_edge = clamp(edge / 0.08, 0.0, 1.0)
    height = inside * (0.55 + 0.3 * round_edge * (2.0 - round_edge)) + 0.07 * worn
    return (
        share * inside,
        1.0 - inside,
        light * inside + (1.0 - inside) * (0.92 + 0.06 * worn),
        height,
    )


@shared
def tiles(p, q, r, footprint, seed):
    """Square glazed tiles with a grout of the second colour; the third in some tiles."""
    inside, bits, edge = _block(p, q, 1.0, 0.0, 0.03, footprint, seed)
    inside = 0.9 + (inside - 0.9) * fading(1.0, footprint)
    worn = _wear(p, q, r, footprint, seed)
    fine = flat_octaves(6.0 * p, 6.0 * q, 6.0 * footprint, seed + 2, 3)
    other = (1.0 if fraction(bits, 25) < 0.22 else 0.0) * fading(1.5, footprint)
    light = 1.0 + (0.10 * (fraction(bits, 6) - 0.5) + 0.02 * fine) * inside + 0.05 * worn
    light *= 1.0 - 0.12 * (1.0 - inside)
    round_edge = clamp(edge / 0.05, 0.0, 1.0)
    height = 0.4 + 0.5 * inside * round_edge * (2.0 - round_edge) + 0.01 * worn
    return 1.0 - inside, 0.85 * other * inside, light, height


@shared
def planks(p, q, r, footprint, seed):
    """Boards along p, each cut from another place of the tree, nailed with narrow gaps."""
    inside, bits, edge = _block(p, q, 6.0, 0.37, 0.018, footprint, seed)
    inside = 0.95 + (inside - 0.95) * fading(1.0, footprint)
    part, tone = fraction(bits, 5), fraction(bits, 25)
    y = q + 9.0 * part
    bend = flat_octaves(0.25 * p + 31.0 * part, 0.8 * y, footprint, seed + 1, 3)
    grain = wave(2.6 * y + 0.9 * bend) * fading(0.4, footprint)
    fibre = flat_octaves(0.9 * p + 31.0 * part, 13.0 * y, 6.0 * footprint, seed + 2, 4)
    share = clamp(0.35 + 0.22 * grain + 0.13 * fibre + 0.3 * (tone - 0.5), 0.0, 1.0)
    light = (0.82 + 0.34 * tone) * (1.0 + 0.05 * fibre + 0.03 * bend)
    height = inside * (0.55 + 0.3 * clamp(edge / 0.05, 0.0, 1.0)) + 0.04 * fibre
    return share * inside, 0.9 * (1.0 - inside), light * (0.35 + 0.65 * inside), height


@shared
def fabric(p, q, r, footprint, seed):
    """A plain weave of two yarns, with a broad check of the third colour."""
    x, y = clamped(8.0 * p), clamped(8.0 * q)
    column, row = math.floor(x), math.floor(y)
    over = (int(column) + int(row)) & 1
    u, v = x - column - 0.5, y - row - 0.5
    seen = fading(1.0, 8.0 * footprint)
    bulge = (1.0 - 4.0 * v * v) * over + (1.0 - 4.0 * u * u) * (1 - over)
    yarn = hashed(int(row), 11, seed) if over else hashed(int(column), 12, seed)
    uneven = flat_octaves(4.0 * p, 4.0 * q, 4.0 * footprint, seed + 3, 4)
    slow = flat_octaves(0.4 * p, 0.4 * q, footprint, seed + 4, 5)
    light = 1.0 + seen * (0.35 * (bulge - 0.67) + 0.18 * (fraction(yarn, 8) - 0.5))
    light += 0.05 * uneven + 0.04 * slow
    band_x, band_y = clamped(p * 0.5), clamped(q * 0.5)
    band_x, band_y = band_x - math.floor(band_x), band_y - math.floor(band_y)
    wide = 0.5 * footprint
    cross = step(0.15 - abs(band_x - 0.5), wide) + step(0.15 - abs(band_y - 0.5), wide)
    share = 0.5 + seen * (over - 0.5) * 0.8 + 0.04 * uneven
    return clamp(share, 0.0, 1.0), 0.4 * cross, light, 0.4 + 0.4 * seen * bulge + 0.04 * uneven


@shared
def scales(p, q, r, footprint, seed):
    """Overlapping round scales, as of a fish or a roof: row over row, darker towards the root."""
    p, q = clamped(p), clamped(q)
    share, other, light, height = 0.3, 0.0, 0.6, 0.2
    top = math.floor(2.0 * q)
    for place in range(3):
        # From the row that lies lowest to the one that covers it.
        row = top - 1.0 + place
        x = p + 0.5 * (row - 2.0 * math.floor(0.5 * row))
        column = math.floor(x)
        bits = hashed(int(column), int(row), seed)
        dx, dy = x - column - 0.5, q - 0.5 * row
        distance = math.sqrt(dx * dx + 0.8 * dy * dy) / 0.56
        body = step((1.0 - distance) * 0.56, footprint + 0.02)
        rim = clamp(1.0 - (1.0 - distance) / (0.12 + footprint), 0.0, 1.0)
        along = clamp(distance, 0.0, 1.0)
        share += (0.2 + 0.45 * fraction(bits, 8) + 0.3 * along - share) * body
        other += (0.6 * rim - other) * body
        light += (0.66 + 0.45 * along - light) * body
        height += (0.2 + 0.7 * along - height) * body
    seen = fading(0.8, footprint)
    worn = _wear(p, q, r, footprint, seed)
    share = 0.55 + (share - 0.55) * seen
    light = (0.92 + (light - 0.92) * seen) * (1.0 + 0.05 * worn)
    return share, clamp(other * seen, 0.0, 1.0), light, height * seen + 0.03 * worn
