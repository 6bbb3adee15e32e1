"""The hits of one ray in order of (τ, index).

They come nearly in order, which insertion likes; where they do not, as among many large Gaussians
that overlap, a heap bounds the time, and is left when no light is.
"""

import numpy as np

from diff4splat.kernels.addresses import (
    float_at,
    int_at,
    put_float,
    put_int,
    put_word,
    word_at,
)
from diff4splat.kernels.jit import inlined

_MOVES_PER_HIT = 16
"""How many places a hit may move on average before a heap is used."""


@inlined
def swap(at, one, other):
    """Exchange two hits."""
    distance, alpha, rank = _hit(at, one)
    _put(at, one, _hit(at, other))
    _put(at, other, (distance, alpha, rank))


@inlined
def sort_hits(at, ray, dark):
    """Sort the hits of a ray, and drop those after the hit that leaves it ``dark``."""
    first, count = ray * at.room, word_at(at.counts, ray)
    if not _insert_all(at, first, count):
        _take_nearest(at, first, count, dark)
    light = 1.0
    for place in range(first, first + count):
        if light < dark:
            put_word(at.counts, ray, place - first)
            break
        light -= np.float64(float_at(at.alphas, place)) * light


@inlined
def _insert_all(at, first, count):
    """Sort by insertion; False if it takes too many moves."""
    moves = 0
    for last in range(first + 1, first + count):
        if float_at(at.distances, last - 1) < float_at(at.distances, last):
            continue
        hit, place = _hit(at, last), last
        while place > first and _before(at, hit, _hit(at, place - 1)):
            _put(at, place, _hit(at, place - 1))
            place -= 1
        _put(at, place, hit)
        moves += last - place
        if moves > _MOVES_PER_HIT * count:
            return False
    return True


@inlined
def _take_nearest(at, first, count, dark):
    """Take one nearest hit after another off a heap until no light is left.

    The heap is stored backwards: its root is the last index, so hits that are taken fill the front.
    """
    root, light = first + count - 1, 1.0
    for node in range(count // 2 - 1, -1, -1):
        _sink(at, root, node, count)
    for size in range(count, 0, -1):
        if light < dark:
            break
        nearest = root - size + 1
        swap(at, root, nearest)
        _sink(at, root, 0, size - 1)
        light -= np.float64(float_at(at.alphas, nearest)) * light


@inlined
def _sink(at, root, node, size):
    """Let the hit of a node sink until it comes before both below it."""
    hit = _hit(at, root - node)
    while 2 * node + 1 < size:
        child = 2 * node + 1
        if child + 1 < size and _before(at, _hit(at, root - child - 1), _hit(at, root - child)):
            child += 1
        below = _hit(at, root - child)
        if not _before(at, below, hit):
            break
        _put(at, root - node, below)
        node = child
    _put(at, root - node, hit)


@inlined
def _hit(at, place):
    return (
        float_at(at.distances, place),
        float_at(at.alphas, place),
        int_at(at.ranks, place),
    )


@inlined
def _put(at, place, hit):
    put_float(at.distances, place, hit[0])
    put_float(at.alphas, place, hit[1])
    put_int(at.ranks, place, hit[2])


@inlined
def _before(at, one, other):
    """By distance, then by the index of the primitive."""
    if one[0] != other[0]:
        return one[0] < other[0]
    return int_at(at.members, one[2]) < int_at(at.members, other[2])
