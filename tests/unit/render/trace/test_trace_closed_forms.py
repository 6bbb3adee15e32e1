"""Rays whose answers are known on paper, by brute force in float64 and compiled in float32."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_trace import answers, as_array, covariance, ray, scene, sphere

from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import concatenate

KINDS = {torch.float64: 1e-12, torch.float32: 3e-6}
both = pytest.mark.parametrize(("dtype", "room"), KINDS.items(), ids=["reference", "compiled"])


def approx(value: object, room: float):
    return pytest.approx(value, rel=room, abs=room)


@both
def test_a_sphere_dims_with_its_distance_from_the_ray(dtype: torch.dtype, room: float) -> None:
    aside = 0.15
    made = answers(sphere((aside, 0.0, 2.0), dtype=dtype), ray(dtype=dtype), near_distance=0.0)
    alpha = 0.8 * math.exp(-0.5 * (aside / 0.1) ** 2)
    assert made.alpha.item() == approx(alpha, room)
    assert made.rgb[0].tolist() == approx([alpha, alpha * 0.5, alpha * 0.25], room)
    assert made.distance.item() == approx(2.0, room)
    assert made.hits.item() == 1


@both
def test_distance_is_the_projection_of_the_mean_on_the_ray(dtype: torch.dtype, room: float) -> None:
    slanted = ray((0.3, -0.2, 0.1), (0.05, 0.1, 2.0), dtype)
    made = answers(sphere(scale=1.0, dtype=dtype), slanted)
    offset = np.array([-0.3, 0.2, 1.9])
    assert made.distance.item() == approx(float(offset @ as_array(slanted.directions)[0]), room)


@both
@pytest.mark.parametrize("degree", [2, 4])
def test_an_ellipsoid_responds_as_its_densest_point_on_the_ray(
    degree: int, dtype: torch.dtype, room: float
) -> None:
    cloud = scene(30, seed=4, dtype=dtype)
    generator = np.random.default_rng(0)
    for i in range(len(cloud)):
        one = cloud.select(slice(i, i + 1))
        mean, scale = as_array(one.means)[0], as_array(one.scales)[0]
        toward = mean + 0.5 * scale.min() * generator.standard_normal(3)
        line = ray(tuple(toward - 4 * generator.standard_normal(3)), (1.0, 0.0, 0.0), dtype)
        line = Rays(
            origins=line.origins, directions=torch.tensor(toward, dtype=dtype) - line.origins
        )
        precision = np.linalg.inv(covariance(as_array(one.quats)[0], scale))
        steps = np.linspace(0, 12, 40_001)
        points = as_array(line.origins)[0] + steps[:, None] * as_array(line.directions)[0] - mean
        squared = np.einsum("ti,ij,tj->t", points, precision, points)
        best = squared.min()
        want = float(one.opacities[0]) * math.exp(-0.5 * best if degree == 2 else -(best**2) / 18)
        made = answers(one, line, kernel_degree=degree, alpha_cutoff=1e-6, alpha_max=1 - 1e-6)
        assert made.alpha.item() == approx(want, max(room, 1e-5))
        assert made.distance.item() == approx(steps[squared.argmin()], 1e-3)


@both
def test_two_spheres_look_alike_in_either_order(dtype: torch.dtype, room: float) -> None:
    near = sphere((0.05, 0.0, 2.0), 0.1, 0.6, (1.0, 0.0, 0.0), dtype)
    far = sphere((-0.05, 0.0, 3.0), 0.2, 0.7, (0.0, 0.0, 1.0), dtype)
    line = ray(dtype=dtype)
    one, other = answers(concatenate([near, far]), line), answers(concatenate([far, near]), line)
    assert torch.equal(one.rgb, other.rgb)
    assert torch.equal(one.distance, other.distance)
    first, second = 0.6 * math.exp(-0.125), 0.7 * math.exp(-0.03125)
    assert one.rgb[0].tolist() == approx([first, 0, (1 - first) * second], room)
    # Seen from the other side the order is the other one.
    back = ray((0.0, 0.0, 5.0), (0.0, 0.0, -1.0), dtype)
    behind = answers(concatenate([near, far]), back)
    assert behind.rgb[0].tolist() == approx([(1 - second) * first, 0, second], room)


@both
def test_equal_distances_are_blended_by_index(dtype: torch.dtype, room: float) -> None:
    red, blue = (sphere(rgb=rgb, dtype=dtype) for rgb in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    made = answers(concatenate([red, blue]), ray(dtype=dtype))
    assert made.rgb[0].tolist() == approx([0.8, 0.0, 0.16], room)
    made = answers(concatenate([blue, red]), ray(dtype=dtype))
    assert made.rgb[0].tolist() == approx([0.16, 0.0, 0.8], room)


@both
def test_expected_and_median_distance_of_three_sheets(dtype: torch.dtype, room: float) -> None:
    sheets = concatenate([sphere((0.0, 0.0, z), 0.1, 0.4, dtype=dtype) for z in (2.0, 3.0, 5.0)])
    made = answers(sheets, ray(dtype=dtype))
    weights = [0.4, 0.24, 0.144]
    assert made.distance.item() == approx((0.8 + 0.72 + 0.72) / sum(weights), room)
    # 0.6 of the light is left behind the first, 0.36 behind the second.
    assert made.median_distance.item() == approx(3.0, room)
    first = answers(sheets.select(slice(0, 1)), ray(dtype=dtype))
    assert first.median_distance.item() == 0.0


@both
def test_opaque_is_held_below_one(dtype: torch.dtype, room: float) -> None:
    wall = concatenate([sphere((0.0, 0.0, 2.0 + i), opacity=1.0, dtype=dtype) for i in range(4)])
    made = answers(wall, ray(dtype=dtype))
    # Behind two of them (1 - 0.99)² of the light is left, which is the cutoff: the ray is done.
    assert made.hits.item() == 2
    assert made.alpha.item() == approx(1 - 1e-4, room)
    assert answers(wall, ray(dtype=dtype), light_cutoff=1e-5).hits.item() == 3


@both
def test_what_lies_behind_or_too_near_is_not_there(dtype: torch.dtype, room: float) -> None:
    for z, seen in ((-2.0, 0), (0.0, 0), (0.4, 0), (0.6, 1)):
        made = answers(sphere((0.0, 0.0, z), 1.0, dtype=dtype), ray(dtype=dtype), near_distance=0.5)
        assert made.hits.item() == seen
        assert made.alpha.item() == approx(0.8 * seen, room)


@both
def test_from_inside_a_gaussian_its_peak_ahead_is_seen(dtype: torch.dtype, room: float) -> None:
    inside = ray((0.0, 0.0, 1.5), dtype=dtype)
    made = answers(sphere(scale=1.0, dtype=dtype), inside)
    assert made.alpha.item() == approx(0.8, room)
    assert made.distance.item() == approx(0.5, room)


@both
def test_support_ends_exactly_at_the_cutoff(dtype: torch.dtype, room: float) -> None:
    reach = 0.1 * math.sqrt(2 * math.log(0.8 * 255))
    for part, hits in ((0.9999, 1), (1.0001, 0)):
        made = answers(sphere((part * reach, 0.0, 2.0), dtype=dtype), ray(dtype=dtype))
        assert made.hits.item() == hits


@both
def test_support_ends_at_the_least_response(dtype: torch.dtype, room: float) -> None:
    reach = 0.1 * (18 * -math.log(0.0113)) ** 0.25
    preset = {"kernel_degree": 4, "min_response": 0.0113}
    for part, hits in ((0.9999, 1), (1.0001, 0)):
        cloud = sphere((part * reach, 0.0, 2.0), opacity=1.0, dtype=dtype)
        assert answers(cloud, ray(dtype=dtype), **preset).hits.item() == hits


@both
def test_faint_gaussians_are_nothing(dtype: torch.dtype, room: float) -> None:
    for opacity, hits in ((0.0, 0), (0.0039, 0), (0.004, 1)):
        made = answers(sphere(opacity=opacity, dtype=dtype), ray(dtype=dtype))
        assert made.hits.item() == hits


@both
def test_background_fills_what_light_is_left(dtype: torch.dtype, room: float) -> None:
    background = (0.2, 0.4, 0.6)
    made = answers(sphere(dtype=dtype), ray(dtype=dtype), background=background)
    assert made.rgb[0].tolist() == approx([0.84, 0.48, 0.32], room)
    empty = answers(sphere((0.0, 9.0, 2.0), dtype=dtype), ray(dtype=dtype), background=background)
    assert empty.rgb[0].tolist() == approx(list(background), room)


@both
def test_harmonics_are_seen_along_the_ray_or_toward_the_mean(
    dtype: torch.dtype, room: float
) -> None:
    one = sphere((0.2, 0.0, 2.0), 0.5, dtype=dtype)
    lobes = torch.zeros(1, 4, 3, dtype=dtype)
    lobes[0, 3] = 1.0
    cloud = replace(one, sh=lobes)
    alpha = 0.8 * math.exp(-0.5 * 0.16)
    along = answers(cloud, ray(dtype=dtype))
    toward = answers(cloud, ray(dtype=dtype), color_direction="mean")
    assert along.rgb[0, 0].item() == approx(alpha * 0.5, room)
    lobe = 0.5 - 0.4886025119029199 * 0.2 / math.hypot(0.2, 2.0)
    assert toward.rgb[0, 0].item() == approx(alpha * lobe, room)


@both
def test_a_quaternion_of_zero_turns_nothing(dtype: torch.dtype, room: float) -> None:
    cloud = scene(20, dtype=dtype)
    own = replace(cloud, quats=torch.zeros_like(cloud.quats))
    identity = torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=dtype).repeat(20, 1)
    line = ray((-4.0, 0.1, 0.2), (1.0, 0.0, 0.0), dtype)
    got, want = answers(own, line), answers(replace(cloud, quats=identity), line)
    assert want.hits.item() > 0
    assert torch.equal(got.rgb, want.rgb)


@both
def test_far_from_the_origin_nothing_changes(dtype: torch.dtype, room: float) -> None:
    # Numbers that are exact in float32 a million units away.
    cloud = sphere((0.25, -0.125, 2.0), 0.5, dtype=dtype)
    line = ray((0.0, 0.125, 0.0), (0.125, -0.0625, 1.0), dtype)
    shift = torch.tensor([1048576.0, -1048576.0, 524288.0], dtype=dtype)
    moved = Rays(origins=line.origins + shift, directions=line.directions)
    want = answers(cloud, line)
    got = answers(replace(cloud, means=cloud.means + shift), moved)
    assert got.alpha.item() == approx(want.alpha.item(), room)
    assert got.distance.item() == approx(want.distance.item(), room)
