"""Textures that grow or weather: made of noise.

Every function takes a point and the footprint of a sample, both in features, and a seed. It returns
(share of the second colour, share of the third, brightness, height from 0 to 1).
"""

import math

from diff4splat.data_prep.synthetic.renderer.numerics import clamp, fading, ramp, step, wave
from diff4splat.data_prep.synthetic.renderer.textures.noise import (
    cells,
    flat_noise,
    flat_octaves,
    fraction,
    hashed,
    noise,
    octaves,
)
from diff4splat.kernels.jit import shared


@shared
def plain(p, q, r, footprint, seed):
    """One colour with faint stains and grain."""
    stain = flat_octaves(p + 0.6 * r, q - 0.4 * r, footprint, seed, 5)
    grain = flat_octaves(14.0 * p, 14.0 * q, 14.0 * footprint, seed + 5, 2)
    light = 1.0 + 0.045 * stain + 0.03 * grain
    return clamp(0.06 * stain, 0.0, 1.0), 0.0, light, 0.5 + 0.08 * grain


@shared
def cloudy(p, q, r, footprint, seed):
    """1/f noise between the colours."""
    coarse = octaves(0.35 * p, 0.35 * q, 0.35 * r, 0.35 * footprint, seed, 8)
    other = octaves(0.6 * p, 0.6 * q, 0.6 * r, 0.6 * footprint, seed + 71, 5)
    share = clamp(0.5 + 0.3 * coarse, 0.0, 1.0)
    return share, ramp(other, 0.3, 1.6), 1.0 + 0.05 * other, share


@shared
def wood(p, q, r, footprint, seed):
    """Year rings about an axis along q, bent by slow noise; fibres and pores along q."""
    bend = noise(0.4 * p, 0.12 * q, 0.4 * r, seed) + 0.35 * noise(p, 0.3 * q, r, seed + 1)
    x, z = p + 0.37 + 1.2 * bend, r - 0.61 + 0.9 * bend
    ring = math.sqrt(x * x + z * z) * 2.0
    part = ring - math.floor(ring)
    year = fraction(hashed(math.floor(ring), 3, seed), 9)
    late = ramp(part, 0.15, 0.85) * (1.0 - step(part - 0.93, footprint * 2.0 + 0.05))
    late = 0.45 + (late - 0.45) * fading(0.5, footprint)
    fibre = octaves(14.0 * p, 0.7 * q, 14.0 * r, 6.0 * footprint, seed + 2, 4)
    stain = octaves(0.5 * p, 0.2 * q, 0.5 * r, footprint, seed + 3, 4)
    share = clamp(0.75 * late * (0.55 + 0.6 * year) + 0.10 * fibre + 0.06 * stain, 0.0, 1.0)
    pores = ramp(fibre, 0.9, 2.2) * 0.5
    return share, pores * 0.6, 1.0 + 0.05 * stain - 0.2 * pores, 0.5 - 0.25 * late - 0.2 * pores


@shared
def marble(p, q, r, footprint, seed):
    """Veins: bands bent by turbulence, sharp on one side, fading on the other."""
    bend = octaves(0.7 * p, 0.7 * q, 0.7 * r, footprint, seed, 6)
    slow = octaves(0.3 * p, 0.3 * q, 0.3 * r, footprint, seed + 13, 4)
    first = 1.0 - abs(wave(0.5 * (0.6 * p + 0.35 * q + 0.2 * r) + 0.36 * bend))
    second = 1.0 - abs(wave(0.8 * (0.2 * p - 0.5 * q + 0.4 * r) + 0.42 * slow + 0.13 * bend))
    vein = first * first * first * first
    fine = second * second
    fine = fine * fine * fine * fine
    seen = fading(2.0, footprint)
    share = clamp(0.62 * (0.25 + (vein - 0.25) * seen) + 0.16 * (1.0 + slow), 0.0, 1.0)
    return (
        share,
        clamp(0.75 * seen * fine * ramp(slow, -0.6, 1.0), 0.0, 1.0),
        1.0 + 0.04 * bend,
        0.5,
    )


@shared
def stone(p, q, r, footprint, seed):
    """Rubble: irregular stones in mortar, each of its own tone, pitted."""
    warp = 0.09 * flat_octaves(1.5 * p, 1.5 * q, 1.5 * footprint, seed + 1, 3)
    first, second, _, _, bits = cells(p + warp, q + 0.31 * r - warp, 0.85, seed)
    gap = second - first
    body = step(gap - 0.09, footprint + 0.05)
    body = 0.85 + (body - 0.85) * fading(1.0, footprint)
    rough = flat_octaves(3.0 * p, 3.0 * q, 3.0 * footprint, seed + 2, 5)
    seen = fading(1.5, footprint)
    tone = 0.5 + (fraction(bits, 12) - 0.5) * seen
    light = (0.72 + 0.5 * tone) * (1.0 + 0.11 * rough)
    dome = clamp(1.6 * gap, 0.0, 1.0)
    share = clamp(0.35 + 0.7 * (fraction(bits, 28) - 0.5) * seen + 0.12 * rough, 0.0, 1.0)
    height = body * (0.35 + 0.5 * dome * (2.0 - dome)) + 0.06 * rough
    return share * body, 1.0 - body, light * body + (1.0 - body) * 0.8, height


@shared
def grass(p, q, r, footprint, seed):
    """Blades that lean about, in tufts, with dry patches."""
    tuft = flat_octaves(0.25 * p, 0.25 * q, footprint, seed, 5)
    lean = 1.4 * flat_noise(0.8 * p, 0.8 * q, seed + 4)
    along, across = q + lean * 0.5, p + lean * q * 0.08 + lean
    blade = flat_octaves(11.0 * across, 2.6 * along, 5.0 * footprint, seed + 1, 3)
    other = flat_octaves(2.6 * along, 11.0 * across, 5.0 * footprint, seed + 2, 3)
    height = clamp(0.5 + 0.22 * max(blade, other) + 0.1 * tuft, 0.0, 1.0)
    share = clamp(0.4 + 0.26 * tuft + 0.14 * blade, 0.0, 1.0)
    dry = ramp(flat_octaves(0.12 * p, 0.12 * q, footprint, seed + 3, 5), 0.5, 2.2)
    light = clamp(0.98 + 0.3 * (height - 0.55) / 0.45 + 0.11 * tuft, 0.3, 1.5)
    return share, 0.7 * dry, light, height


@shared
def plaster(p, q, r, footprint, seed):
    """Trowelled wall: broad strokes, pits, stains."""
    stroke = flat_octaves(0.8 * p + 0.5 * q, 1.7 * q - 0.3 * p, footprint, seed, 5)
    pit = noise(6.0 * p, 6.0 * q, 6.0 * r, seed + 1) * fading(0.16, footprint)
    stain = flat_octaves(0.2 * p, 0.1 * q, footprint, seed + 2, 5)
    hole = ramp(pit, 0.28, 0.45)
    light = 1.0 + 0.05 * stroke + 0.05 * stain - 0.25 * hole
    share = clamp(0.22 + 0.18 * stain + 0.06 * stroke, 0.0, 1.0)
    return share, 0.3 * hole, light, 0.6 + 0.12 * stroke - 0.4 * hole


@shared
def rust(p, q, r, footprint, seed):
    """Paint that has come off a metal: blisters with dark rims."""
    field = octaves(0.5 * p, 0.5 * q, 0.5 * r, 0.5 * footprint, seed, 7)
    fine = octaves(5.0 * p, 5.0 * q, 5.0 * r, 5.0 * footprint, seed + 3, 4)
    bare = ramp(field + 0.12 * fine, 0.15, 0.45 + 0.3 * footprint)
    bare = 0.36 + (bare - 0.36) * fading(4.0, footprint)
    rim = ramp(field, -0.15, 0.2) * (1.0 - bare)
    share = clamp(bare * (0.85 + 0.15 * fine), 0.0, 1.0)
    deep = clamp(bare * ramp(field + 0.3 * fine, 0.6, 1.8) + 0.35 * rim, 0.0, 1.0)
    return share, deep, 1.0 + 0.09 * fine * (0.3 + bare), 0.7 - 0.4 * bare + 0.1 * fine * bare


@shared
def leaves(p, q, r, footprint, seed):
    """Leaf litter in three layers: each leaf turned its own way, with a mid rib."""
    share, deep, light, height = 0.5, 0.6, 0.45, 0.0
    for layer in range(3):
        turn = wave(0.13 * layer + 0.1)
        x, y = p + turn * q + 3.7 * layer, q - turn * p + 1.9 * layer
        _, _, dx, dy, bits = cells(x, y, 0.9, seed + layer)
        angle = fraction(bits, 8)
        c, s = wave(angle + 0.25), wave(angle)
        along, across = dx * c + dy * s, abs(dy * c - dx * s)
        inside = 0.23 * (1.0 - along * along * 3.6) - across
        body = step(inside, footprint + 0.02)
        rib = clamp(1.0 - across / (0.02 + footprint), 0.0, 1.0)
        tone = fraction(bits, 30)
        share += (clamp(tone + 0.25 * rib, 0.0, 1.0) - share) * body
        deep += ((0.55 * fraction(bits, 40) - 0.2) - deep) * body
        light += (0.72 + 0.2 * layer + 0.2 * tone + 0.6 * along * (tone - 0.5) - light) * body
        height += (0.3 * (layer + 1) + 0.2 * across - height) * body
    fine = flat_octaves(4.0 * p, 4.0 * q, 4.0 * footprint, seed + 9, 4)
    seen = fading(1.0, footprint)
    share, deep = 0.52 + (share - 0.52) * seen, 0.28 + (clamp(deep, 0.0, 1.0) - 0.28) * seen
    light = (0.86 + (light - 0.86) * seen) * (1.0 + 0.08 * fine)
    return share, deep, light, height * seen + 0.04 * fine
