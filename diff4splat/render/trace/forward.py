"""The forward pass: primitives → tree → packets → hits → outputs per ray.

Every stage is spread over threads in parts whose results do not depend on which thread does them.
"""

import math

import numpy as np

from diff4splat.kernels.parallel import parallel_for, ranges
from diff4splat.render.raster.padded_image import empty
from diff4splat.render.trace.bvh.boxes import PRIMITIVES_PER_PART, swept_boxes
from diff4splat.render.trace.bvh.leaves import gather_leaves
from diff4splat.render.trace.bvh.primitives import prepare
from diff4splat.render.trace.bvh.tree import NO_ORDER, build_tree
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.shading.shade import OUTPUT_COLUMNS, shade
from diff4splat.render.trace.tables import (
    MEAN,
    MOVING_COLUMNS,
    STATIC_COLUMNS,
    Cloud,
    Doubles,
    Floats,
    Integers,
    MotionArrays,
    TraceInputs,
    TraceRules,
    TraceScene,
    Tree,
)
from diff4splat.render.trace.traversal.packets import bundle_rays

PACKETS_PER_PART = 16
_SAMPLED = 1024
"""Gaussians from which the distance of the scene is estimated."""
_LEAST_SIZE = 1e-30
_BYTES_PER_HIT, _SHARES = 12, 16
"""A packet may use a sixteenth of the memory, whatever the threads: that says where it is cut."""
_LEAST_EXPONENT = -125.0
"""Smaller powers of 2 are no normal numbers in float32."""
_LARGEST_ALPHA = 1 - 2.0**-24
"""In float32; the backward pass divides light by 1 - alpha."""


def make_rules(settings: TraceSettings, squared_gate: float) -> TraceRules:
    """What of the settings the kernels need."""
    drop = math.inf if settings.min_response is None else -math.log(settings.min_response)
    quartic = settings.kernel_degree == 4
    # Integers would compile every kernel again.
    return TraceRules(
        log2_cutoff=max(math.log2(settings.alpha_cutoff), _LEAST_EXPONENT),
        alpha_max=min(float(settings.alpha_max), _LARGEST_ALPHA),
        dark=settings.dark,
        near=float(settings.near_distance),
        least_drop=drop,
        squared_limit=math.sqrt(18 * drop) if quartic else 2 * drop,
        squared_gate=squared_gate,
        quartic=quartic,
        toward_mean=settings.color_direction == "mean",
    )


def make_primitives(
    cloud: Cloud, motion: MotionArrays, rules: TraceRules
) -> tuple[Doubles, Doubles]:
    """Primitives (n × 16, or 24 if they move), and their reach in deviations (n)."""
    count, moves = len(cloud.means), len(motion.velocities) > 0
    primitives = np.zeros((count, MOVING_COLUMNS if moves else STATIC_COLUMNS))
    reach = np.empty(count)

    def work(first: int, last: int) -> None:
        prepare(first, last, cloud, motion, rules, primitives, reach)

    parallel_for(work, ranges(count, PRIMITIVES_PER_PART))
    return primitives, reach


def make_scene(
    cloud: Cloud,
    motion: MotionArrays,
    colors: Floats,
    times: Floats,
    rules: TraceRules,
    order: Integers = NO_ORDER,
) -> TraceScene:
    """The scene for rays between the earliest and the latest of ``times``.

    ``order`` is an order of the Gaussians in which neighbours follow each other.
    """
    primitives, reach = make_primitives(cloud, motion, rules)
    earliest, latest = (float(times.min()), float(times.max())) if len(times) else (0.0, 0.0)
    tree = build_tree(swept_boxes(primitives, reach, earliest, latest), order)
    moment = 0.5 * (earliest + latest)
    leaves = gather_leaves(tree, primitives, reach, moment)
    return TraceScene(primitives, tree, leaves, moment, colors)


def shade_rays(inputs: TraceInputs) -> tuple[Floats, Integers]:
    """Outputs of every ray (r × 7), and the number of its hits."""
    count = len(inputs.rays.origins)
    outputs, hits = empty(count, OUTPUT_COLUMNS), np.empty(count, np.int32)

    def work(first: int, last: int) -> None:
        shade(first, last, inputs, outputs, hits)

    parallel_for(work, ranges(len(inputs.rays.starts) - 1, PACKETS_PER_PART))
    return outputs, hits


def make_inputs(
    scene: TraceScene,
    arrays: tuple[Floats, Floats, Floats],
    settings: TraceSettings,
    rules: TraceRules,
    bands: int,
) -> TraceInputs:
    """Rays (origins, directions, times) cut into packets."""
    return TraceInputs(
        scene,
        bundle_rays(
            *arrays, _viewed_size(scene.tree, arrays[0]), _viewed_distance(scene, arrays[0])
        ),
        rules,
        bands,
        settings.memory_bytes // (_BYTES_PER_HIT * _SHARES),
    )


def _viewed_size(tree: Tree, origins: Floats) -> float:
    """Half size of the scene, and how far away the first ray begins."""
    corners = tree.nodes[-1:][np.isfinite(tree.nodes[-1:])]
    away = origins[:1].astype(np.float64) - tree.anchor
    return max(float(np.abs(corners).max(initial=0.0) + np.abs(away).max(initial=0.0)), _LEAST_SIZE)


def _viewed_distance(scene: TraceScene, origins: Floats) -> float:
    """From the first ray's origin to half of the scene's Gaussians, by some of them."""
    order = scene.tree.order
    if not len(order) or not len(origins):
        return _LEAST_SIZE
    some = order[:: max(len(order) // _SAMPLED, 1)]
    away = scene.primitives[some, MEAN : MEAN + 3] - origins[:1]
    return max(float(np.median(np.linalg.norm(away, axis=1))), _LEAST_SIZE)
