"""What the packets of a bundle hit: the part that the way forward and the way back share."""

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
    """Fill ``scratch`` with the hits of the rays at ``first`` to ``last``, or say what is short."""
    scene, rays = inputs.scene, inputs.rays
    frame = make_frame(rays, first, last)
    place_rays(rays, first, last, frame, scratch.numbers)
    make_beam(scratch.numbers, last - first, frame, scene.tree.anchor, scratch.planes, scratch.rows)
    found = find_candidates(scene, frame, scratch)
    if found < 0:
        return _MORE_CANDIDATES
    if not intersect_all(scene, frame, inputs.rules, scratch, found, last - first):
        return _MORE_HITS
    return _DONE


@shared
def traverse_in_parts(inputs, first, last, scratch):
    """As `look` for as many rays from ``first`` on as fit; returns where it ended and the scratch.

    The room for hits grows up to ``inputs.most_hits``; then fewer rays are done at once. One ray
    gets what it needs.
    """
    while True:
        said = traverse(inputs, first, last, scratch)
        if said == _DONE:
            return last, scratch
        hits = len(scratch.distances)
        if said == _MORE_CANDIDATES:
            scratch = make_scratch(_GROWTH * len(scratch.keys), hits)
        elif _GROWTH * hits <= inputs.most_hits or last - first == 1:
            scratch = make_scratch(len(scratch.keys), _GROWTH * hits)
        else:
            last = first + (last - first + 1) // 2
