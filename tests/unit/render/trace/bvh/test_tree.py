"""Boxes, the search tree, and that it finds what brute force finds."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_trace import as_array, bundle, covariance, image, motion, scene

from diff4splat.render.trace.bvh.boxes import Boxes, swept_boxes, united
from diff4splat.render.trace.bvh.radix_sort import hilbert, sorted_order
from diff4splat.render.trace.bvh.tree import build_tree
from diff4splat.render.trace.forward import make_inputs, make_rules, make_scene, shade_rays
from diff4splat.render.trace.jit import GROUP
from diff4splat.render.trace.moving import MovingCloud
from diff4splat.render.trace.rays import Rays
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.render.trace.tables import Cloud, MotionArrays, TraceInputs, TraceRules, TraceScene
from diff4splat.scene.gaussians import Gaussians

NONE = np.empty(0, np.float32)


@pytest.fixture(autouse=True, scope="module")
def _compiled() -> None:
    GROUP.ensure_compiled()


def scene_of(
    cloud: Gaussians, rules: TraceRules, moving: MovingCloud | None = None, times: np.ndarray = NONE
) -> TraceScene:
    """Float32 Gaussians as rays look at them, white."""
    arrays = [getattr(cloud, n).numpy() for n in ("means", "quats", "scales", "opacities")]
    still = MotionArrays(np.empty((0, 3), np.float32), NONE, NONE)
    if moving is not None:
        still = MotionArrays(
            moving.velocities.numpy(), moving.time_centers_s.numpy(),
            moving.time_deviations_s.numpy(),
        )  # fmt: skip
    colors = np.ones(4 * len(cloud), np.float32)
    return make_scene(Cloud(*arrays), still, colors, times, rules)


def inputs_of(
    world: TraceScene, rays: Rays, rules: TraceRules, times: np.ndarray = NONE
) -> TraceInputs:
    arrays = (rays.origins.numpy(), rays.directions.numpy(), times)
    return make_inputs(world, arrays, TraceSettings(), rules, 1)


def rules_of(reach: float = math.inf, **changes: object) -> TraceRules:
    return make_rules(TraceSettings(**({"near_distance": 0.0} | changes)), reach)


@pytest.mark.parametrize("degree", [2, 4])
def test_boxes_touch_the_ellipsoids_where_alpha_is_the_cutoff(degree: int) -> None:
    cloud, rules = scene(20, dtype=torch.float32), rules_of(kernel_degree=degree)
    world = scene_of(cloud, rules)
    for i in range(20):
        drop = math.log(max(float(cloud.opacities[i]) * 255, 1.0))
        if drop == 0:
            continue
        squared = 2 * drop if degree == 2 else math.sqrt(18 * drop)
        sigma = covariance(as_array(cloud.quats)[i], as_array(cloud.scales)[i])
        half = np.sqrt(squared * np.diag(sigma))
        reach = np.array([math.sqrt(squared)])
        made = swept_boxes(world.primitives[i : i + 1], reach, 0.0, 0.0)
        np.testing.assert_allclose(made.upper[0], as_array(cloud.means)[i] + half, rtol=1e-6)
        np.testing.assert_allclose(made.lower[0], as_array(cloud.means)[i] - half, rtol=1e-6)


def test_swept_boxes_hold_every_time_between_and_no_more() -> None:
    cloud, moving = scene(20, dtype=torch.float32), motion(20, dtype=torch.float32)
    world = scene_of(cloud, rules_of(), moving, np.array([0.0, 1.0], np.float32))
    reach = np.full(20, 2.0)
    swept = swept_boxes(world.primitives, reach, -0.5, 2.0)
    frozen = [swept_boxes(world.primitives, reach, t, t) for t in np.linspace(-0.5, 2.0, 7)]
    around = united(frozen)
    np.testing.assert_allclose(around.lower, swept.lower)
    np.testing.assert_allclose(around.upper, swept.upper)


def test_what_is_never_seen_has_no_box_and_is_not_in_the_tree() -> None:
    cloud = scene(40, dtype=torch.float32)
    faint = torch.arange(40) % 3 == 0
    cloud = replace(cloud, opacities=torch.where(faint, 0.001, cloud.opacities + 0.01))
    world = scene_of(cloud, rules_of())
    assert sorted(world.tree.order.tolist()) == np.flatnonzero(~faint.numpy()).tolist()


@pytest.mark.parametrize("count", [0, 1, 16, 17, 256, 257, 5000])
def test_every_node_holds_its_children(count: int) -> None:
    generator = np.random.default_rng(count)
    middle = generator.normal(size=(count, 3)) * 10 ** generator.uniform(-3, 3, (count, 1))
    half = 10 ** generator.uniform(-6, 2, (count, 3))
    boxes = Boxes(middle - half, middle + half)
    tree = build_tree(boxes)
    assert sorted(tree.order.tolist()) == list(range(count))
    anchor = np.array(tree.anchor)
    for level in range(len(tree.levels) - 1):
        for node in range(tree.levels[level], tree.levels[level + 1]):
            for child in range(16):
                number = 16 * (node - tree.levels[level]) + child
                low, high = tree.nodes[node, :3, child], tree.nodes[node, 3:, child]
                if level > 0:
                    inside = tree.nodes[tree.levels[level - 1] + number] if number < (
                        tree.levels[level] - tree.levels[level - 1]
                    ) else None  # fmt: skip
                    if inside is None:
                        assert (low > high).all()
                    else:
                        assert (inside[:3].min(1) >= low).all()
                        assert (inside[3:].max(1) <= high).all()
                else:
                    own = tree.order[16 * number : 16 * number + 16]
                    if len(own) == 0:
                        assert (low > high).all()
                    else:
                        assert (boxes.lower[own].min(0) - anchor >= low).all()
                        assert (boxes.upper[own].max(0) - anchor <= high).all()


def test_refitting_keeps_the_order_and_holds_the_new_boxes() -> None:
    generator = np.random.default_rng(0)
    middle = generator.normal(size=(300, 3))
    tree = build_tree(Boxes(middle - 0.1, middle + 0.1))
    moved = Boxes(middle + 4.9, middle + 5.3)
    fitted, fresh = build_tree(moved, tree.order), build_tree(moved)
    assert np.array_equal(fitted.order, tree.order)
    root = fitted.nodes[-1]
    low = root[:3].min(1) + fitted.anchor
    np.testing.assert_allclose(low, moved.lower.min(0), rtol=1e-5)
    np.testing.assert_allclose(fresh.anchor, fitted.anchor)


def test_sorting_is_stable() -> None:
    generator = np.random.default_rng(0)
    for high in (1, 5, 1 << 20, 1 << 62):
        keys = generator.integers(0, high, 3000).astype(np.uint64)
        assert np.array_equal(sorted_order(keys), np.argsort(keys, kind="stable"))
    assert len(sorted_order(np.empty(0, np.uint64))) == 0


@pytest.mark.parametrize("dimensions", [2, 3])
def test_the_curve_visits_every_cell_and_steps_to_neighbours(dimensions: int) -> None:
    side = 8
    cells = np.stack(np.meshgrid(*[np.arange(side)] * dimensions), -1).reshape(-1, dimensions)
    places = [hilbert.py_func(cell.copy(), dimensions, 3) for cell in cells]
    assert sorted(places) == list(range(side**dimensions))
    steps = np.abs(np.diff(cells[np.argsort(places)], axis=0)).sum(1)
    assert (steps == 1).all()


def without_search(world: TraceScene) -> TraceScene:
    """The same world, whose boxes and extents leave nothing out."""
    nodes, leaves = world.tree.nodes.copy(), world.leaves.copy()
    full = np.isfinite(nodes[:, :1]) & (nodes[:, :1] <= nodes[:, 3:4])
    nodes[:, :3], nodes[:, 3:] = np.where(full, -1e30, np.inf), np.where(full, 1e30, -np.inf)
    leaves[:, 12] = np.where(np.isnan(leaves[:, 12]), np.nan, np.inf)
    return world._replace(tree=world.tree._replace(nodes=nodes), leaves=leaves)


def assert_same_as_without_search(
    cloud: Gaussians, rays: Rays, moving: MovingCloud | None = None, **changes: object
) -> int:
    """Equal bits with and without the tree; returns how many hits there are."""
    times = NONE if moving is None else rays.time_s.numpy()
    rules = rules_of(math.inf if moving is None else moving.gate_reach**2, **changes)
    world = scene_of(cloud, rules, moving, times)
    inputs = inputs_of(world, rays, rules, times)
    seen, hits = shade_rays(inputs)
    all_seen, all_hits = shade_rays(inputs._replace(scene=without_search(world)))
    assert np.array_equal(hits, all_hits)
    assert np.array_equal(seen, all_seen)
    return int(hits.sum())


@pytest.mark.parametrize("name", ["around", "pinhole", "lens", "moving", "far away"])
def test_the_tree_finds_all_hits(name: str) -> None:
    cloud, rays, moving = (
        scene(700, seed=3, dtype=torch.float32),
        bundle(300, dtype=torch.float32),
        None,
    )
    cloud = replace(cloud, scales=0.3 * cloud.scales)
    if name in ("pinhole", "lens"):
        rays = image((20, 25), 15.0, torch.float32, 0.05 * (name == "lens"))
    if name == "moving":
        rays, moving = (
            bundle(300, dtype=torch.float32, times=True),
            motion(700, dtype=torch.float32),
        )
    if name == "far away":
        shift = torch.tensor([1e6, -1e6, 5e5])
        cloud = replace(cloud, means=cloud.means + shift)
        rays = Rays(origins=rays.origins + shift, directions=rays.directions)
    assert assert_same_as_without_search(cloud, rays, moving, light_cutoff=1e-30) > 500


@settings(max_examples=25, deadline=None)
@given(
    st.integers(1, 60),
    st.integers(0, 10_000),
    st.tuples(st.floats(-6, 3), st.floats(-6, 3)),
    st.sampled_from([1e-3, 1.0, 1e3]),
    st.booleans(),
)
def test_the_tree_finds_all_hits_of_any_scene(
    count: int, seed: int, exponents: tuple[float, float], size: float, moves: bool
) -> None:
    generator = torch.Generator().manual_seed(seed)
    low, high = sorted(exponents)
    powers = low + (high - low) * torch.rand(count, 3, generator=generator)
    cloud = scene(count, seed, dtype=torch.float32)
    cloud = replace(cloud, scales=10**powers, means=size * cloud.means)
    # Half of the rays aim at means.
    rays = bundle(40, seed, torch.float32, times=True)
    aimed = cloud.means[torch.arange(20) % count] - rays.origins[:20]
    directions = torch.cat([aimed, rays.directions[20:]])
    rays = replace(rays, directions=directions)
    moving = motion(count, seed, torch.float32) if moves else None
    assert_same_as_without_search(cloud, rays, moving, light_cutoff=1e-30)
