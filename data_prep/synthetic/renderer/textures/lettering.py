"""Texture of printed words, from a font of 5 × 7 dots per letter."""

import math

import numpy as np

from diff4splat.data_prep.synthetic.renderer.numerics import blend, clamp, clamped, fading
from diff4splat.data_prep.synthetic.renderer.textures.noise import flat_octaves, fraction, hashed
from diff4splat.kernels.jit import shared

_LETTERS = """
01110 10001 10001 11111 10001 10001 10001  11110 10001 10001 11110 10001 10001 11110
01110 10001 10000 10000 10000 10001 01110  11110 10001 10001 10001 10001 10001 11110
11111 10000 10000 11110 10000 10000 11111  11111 10000 10000 11110 10000 10000 10000
01110 10001 10000 10111 10001 10001 01111  10001 10001 10001 11111 10001 10001 10001
01110 00100 00100 00100 00100 00100 01110  00111 00010 00010 00010 00010 10010 01100
10001 10010 10100 11000 10100 10010 10001  10000 10000 10000 10000 10000 10000 11111
10001 11011 10101 10101 10001 10001 10001  10001 11001 10101 10011 10001 10001 10001
01110 10001 10001 10001 10001 10001 01110  11110 10001 10001 11110 10000 10000 10000
01110 10001 10001 10001 10101 10010 01101  11110 10001 10001 11110 10100 10010 10001
01111 10000 10000 01110 00001 00001 11110  11111 00100 00100 00100 00100 00100 00100
10001 10001 10001 10001 10001 10001 01110  10001 10001 10001 10001 10001 01010 00100
10001 10001 10001 10101 10101 11011 10001  10001 10001 01010 00100 01010 10001 10001
10001 10001 01010 00100 00100 00100 00100  11111 00001 00010 00100 01000 10000 11111
01110 10001 10011 10101 11001 10001 01110  00100 01100 00100 00100 00100 00100 01110
01110 10001 00001 00110 01000 10000 11111  11111 00010 00100 00010 00001 10001 01110
00010 00110 01010 10010 11111 00010 00010  11111 10000 11110 00001 00001 10001 01110
00110 01000 10000 11110 10001 10001 01110  11111 00001 00010 00100 01000 01000 01000
01110 10001 10001 01110 10001 10001 01110  01110 10001 10001 01111 00001 00010 01100
"""
"""A to Z, 0 to 9; rows from the top."""

_VOWELS = np.array([0, 4, 8, 14, 20], np.int64)
FONT = np.array([[int(row, 2) for row in _LETTERS.split()]], np.int64).reshape(36, 7)
"""Rows of every letter, five bits each."""
_WIDTH, _HEIGHT = 6.0, 9.0
"""Of a letter with the space after it, in dots."""


@shared
def letter_at(column, row, seed):
    """Which letter stands at a place, −1 for a gap: words of 2 to 6, read as if one could."""
    word = column // 7
    place = column - 7 * word
    bits = hashed(word, row, seed)
    if place >= 2 + (bits >> 5) % 5:
        return -1
    if (bits >> 20) & 7 == 0:
        return 26 + (hashed(column, row, seed + 1) >> 7) % 10
    choice = hashed(column, row, seed + 2) >> 9
    if ((bits >> 33) + place) & 1:
        return _VOWELS[choice % 5]
    return choice % 26


@shared
def dot_at(column, row, seed):
    """1 where a dot is printed; ``column`` and ``row`` count dots."""
    letter_column, letter_row = column // 6, row // 9
    x, y = column - 6 * letter_column, row - 9 * letter_row
    if x >= 5 or y >= 7:
        return 0.0
    letter = letter_at(letter_column, letter_row, seed)
    if letter < 0:
        return 0.0
    return float((FONT[letter, y] >> (4 - x)) & 1)


@shared
def lettering(p, q, r, footprint, seed):
    """Lines of words in the second colour, some in the third; one line per feature."""
    x, y = clamped(p * _HEIGHT), clamped(q * _HEIGHT)
    size = _HEIGHT * footprint
    seen = fading(1.5, size)
    # Dots averaged over the footprint: between the four nearest, sharper when near.
    sharp = 1.0 / clamp(size, 0.25, 1.0)
    column, row = math.floor(x - 0.5), math.floor(y - 0.5)
    u = clamp((x - 0.5 - column - 0.5) * sharp + 0.5, 0.0, 1.0)
    v = clamp((y - 0.5 - row - 0.5) * sharp + 0.5, 0.0, 1.0)
    i, j = int(column), int(row)
    upper = blend(dot_at(i, j, seed), dot_at(i + 1, j, seed), u)
    lower = blend(dot_at(i, j + 1, seed), dot_at(i + 1, j + 1, seed), u)
    ink = 0.22 + (blend(upper, lower, v) - 0.22) * seen
    line = hashed(j // 9, 5, seed)
    other = 1.0 if fraction(line, 11) < 0.25 else 0.0
    worn = flat_octaves(1.2 * p, 1.2 * q, 1.2 * footprint, seed + 7, 7)
    ink = clamp(ink * (1.0 - clamp(0.25 * worn - 0.2, 0.0, 0.5)), 0.0, 1.0)
    return ink * (1.0 - other), ink * other, 1.0 + 0.05 * worn, 0.5 + 0.15 * ink + 0.02 * worn
