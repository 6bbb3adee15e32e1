"""Where the samples of a pixel lie: Owen-scrambled Sobol' points, another scrambling per pixel.

Axes: ``p`` pixels, ``samples``, ``dimensions`` (in order: pixel x, pixel y, lens u, lens v, time).
Direction numbers are those of Joe and Kuo (SIAM J. Sci. Comput. 2008, new-joe-kuo-6). Digits are
scrambled, and samples shuffled, by a hash in which each bit is changed by the bits above it
alone: Owen's nested uniform scrambling (Burley, Practical Hash-based Owen Scrambling, JCGT 2020,
with the permutation of Laine and Karras, times an odd number of its own, without which pairs of
samples fill half of their places). All 32-bit words lie in int64.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.errors import ConfigError

MOST_DIMENSIONS = 5
_WORD_BITS, _WORD = 32, 0xFFFFFFFF
_POLYNOMIALS = ((0, 0, ()), (1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)), (3, 2, (1, 1, 1)))
"""(degree, inner coefficients, first direction numbers); the first dimension is van der Corput's.
"""
_PERMUTATION = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)
_MIXING = (0x85EBCA6B, 0xC2B2AE35)
"""Of MurmurHash3's last step."""
_GOLDEN = 0x9E3779B9
_MULTIPLIER = 77
"""Which hash of a permutation's word its factor is."""
_BITS = {torch.float32: 24, torch.float64: 32}
"""How many digits of a point a dtype keeps, so that none rounds up to 1."""


def sample_points(
    pixels: Int[Tensor, " p"],
    samples: int,
    dimensions: int,
    seed: int,
    first: int = 0,
    dtype: torch.dtype = torch.float64,
) -> Float[Tensor, "p samples dimensions"]:
    """Samples ``first`` to ``first + samples`` of every pixel, in [0, 1).

    ``pixels`` are any numbers that tell pixels apart; equal ones get equal points, whatever else is
    asked for with them. Every aligned block of a power of two of samples is a net: it has one
    point in each of as many equal strata of every dimension.

    Raises:
        ConfigError: no samples, more than 2³² of them, a negative ``first``, dimensions not in
            1 to 5, or another dtype than float32 and float64.
    """
    _require(samples, dimensions, first, dtype)
    numbers = torch.arange(first, first + samples, device=pixels.device)
    reverse = _byte_table(torch.tensor([_mirrored(1 << bit) for bit in range(_WORD_BITS)])).to(
        pixels.device
    )
    own = _pixel_words(pixels.long(), seed)
    shuffled = _permuted(_mapped(numbers, reverse)[None], own[:, None])
    points = torch.empty(len(pixels), samples, dimensions, dtype=dtype, device=pixels.device)
    for axis in range(dimensions):
        table = _byte_table(_reversed_directions(axis)).to(pixels.device)
        word = _permuted(_mapped(shuffled, table), _mixed(own, axis + 1)[:, None])
        digits = _mapped(word, reverse) >> (_WORD_BITS - _BITS[dtype])
        points[..., axis] = digits.to(dtype) * 2.0 ** -_BITS[dtype]
    return points


def _require(samples: int, dimensions: int, first: int, dtype: torch.dtype) -> None:
    if not 1 <= dimensions <= MOST_DIMENSIONS:
        raise ConfigError(f"dimensions: expected 1 to {MOST_DIMENSIONS}, got {dimensions}")
    if samples < 1:
        raise ConfigError(f"samples: expected at least 1, got {samples}")
    if first < 0 or first + samples > 1 << _WORD_BITS:
        raise ConfigError(
            f"first: expected 0 or more, and first + samples up to 2^32, got {first} + {samples}"
        )
    if dtype not in _BITS:
        raise ConfigError(f"dtype: expected float32 or float64, got {dtype}")


def _reversed_directions(axis: int) -> Int[Tensor, "32"]:
    """What each bit of a mirrored sample number adds to the mirrored Sobol' word of ``axis``.

    m_k = 2^d m_{k-d} ⊕ m_{k-d} ⊕ Σ_i 2^i a_i m_{k-i}, and v_k = m_k 2^(31 - k).
    """
    degree, inner, numbers = _POLYNOMIALS[axis]
    chosen = list(numbers) if degree else [1] * _WORD_BITS
    for k in range(len(chosen), _WORD_BITS):
        number = chosen[k - degree] ^ (chosen[k - degree] << degree)
        for i in range(1, degree):
            if inner >> (degree - 1 - i) & 1:
                number ^= chosen[k - i] << i
        chosen.append(number)
    words = [_mirrored(m << (_WORD_BITS - 1 - k)) for k, m in enumerate(chosen)]
    return torch.tensor(words[::-1])


def _mirrored(word: int) -> int:
    """The same bits from the other end."""
    return int(f"{word:032b}"[::-1], 2)


def _byte_table(images: Int[Tensor, "32"]) -> Int[Tensor, "4 256"]:
    """What each byte of a word becomes under the map, linear over bits, that has these images."""
    byte = torch.arange(256)
    table = torch.zeros(4, 256, dtype=torch.int64)
    for bit in range(8):
        table ^= images.view(4, 8)[:, bit, None] * (byte >> bit & 1)
    return table


def _mapped(words: Int[Tensor, "*b"], table: Int[Tensor, "4 256"]) -> Int[Tensor, "*b"]:
    """The linear map of ``table``, byte by byte."""
    result = table[0][words & 0xFF]
    for place in range(1, 4):
        result ^= table[place][words >> (8 * place) & 0xFF]
    return result


def _permuted(words: Int[Tensor, "*#b"], own: Int[Tensor, "*#b"]) -> Int[Tensor, "*b"]:
    """A permutation of 32-bit words in which no bit depends on a higher one.

    The 31 bits of the factor keep products below 2^63.
    """
    factor = _mixed(own, _MULTIPLIER) >> 1 | 1
    words = (words + own & _WORD) * factor & _WORD
    for even in _PERMUTATION:
        words = words ^ _times(words, even)
    return words


def _pixel_words(pixels: Int[Tensor, " p"], seed: int) -> Int[Tensor, " p"]:
    """One word per pixel and seed, out of all 64 bits of both."""
    own = _mixed(pixels & _WORD, seed & _WORD)
    return _mixed(_mixed(own, seed >> _WORD_BITS & _WORD) ^ (pixels >> _WORD_BITS & _WORD), 0)


def _mixed(words: Int[Tensor, "*b"], number: int) -> Int[Tensor, "*b"]:
    """A hash of words and a number, both below 2³²."""
    words = words + (number + 1) * _GOLDEN & _WORD
    words = _times(words ^ words >> 16, _MIXING[0])
    words = _times(words ^ words >> 13, _MIXING[1])
    return words ^ words >> 16


def _times(words: Int[Tensor, "*b"], factor: int) -> Int[Tensor, "*b"]:
    """The low 32 bits; the factor is taken as signed so that no product leaves 64."""
    signed = factor - (1 << _WORD_BITS) if factor >> (_WORD_BITS - 1) else factor
    return words * signed & _WORD
