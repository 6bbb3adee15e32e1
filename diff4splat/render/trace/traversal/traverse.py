"""Hits of packets of rays: the part that the forward and the backward pass share."""

from diff4splat.kernels.jit import shared
from diff4splat.render.trace.traversal.candidates import find_candidates
from diff4splat.render.trace.traversal.frame import make_beam, make_frame, place_rays
from diff4splat.render.trace.traversal.intersect import intersect_all
from diff4splat.render.trace.traversal.scratch import make_scratch

_CANDIDATES, _HITS, _GROWTH = 1 << 10, 1 << 13, 2
_MORE_CANDIDATES, _MORE_HITS, _DONE = -1, -2, 0


@shared
def initial_scratch():
    """Scratch for the first packet."""
    return make_scratch(_CANDIDATES, _HITS)


@shared
def traverse(inputs, first, last, scratch):
    """Fill ``scratch`` with the hits of rays ``first`` to ``last``, or return what is too small."""
    scene, rays = inputs.scene, inputs.rays
    frame = make_frame(rays, first, last)
    place_rays(rays, first, last, frame, scratch.numbers)
    make_beam(scratch.numbers, last - first, frame, scene.tree.anchor, scratch.planes, scratch.rows)
    count = find_candidates(scene, frame, scratch)
    if count < 0:
        return _MORE_CANDIDATES
    if not intersect_all(scene, frame, inputs.rules, scratch, count, last - first):
        return _MORE_HITS
    return _DONE


@shared
def traverse_in_parts(inputs, first, last, scratch):
    """As `traverse`, for as many rays from ``first`` on as fit; returns their end and the scratch.

    The room for hits grows up to ``inputs.most_hits``; then fewer rays are traced at once. A single
    ray gets all the room it needs.
    """
    while True:
        status = traverse(inputs, first, last, scratch)
        if status == _DONE:
            return last, scratch
        hits = len(scratch.distances)
        if status == _MORE_CANDIDATES:
            scratch = make_scratch(_GROWTH * len(scratch.keys), hits)
        elif _GROWTH * hits <= inputs.most_hits or last - first == 1:
            scratch = make_scratch(len(scratch.keys), _GROWTH * hits)
        else:
            last = first + (last - first + 1) // 2
