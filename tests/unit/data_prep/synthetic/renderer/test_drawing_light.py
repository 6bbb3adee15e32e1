"""Light on its way to the image: haze, bytes, and what hides a point from the camera."""

from dataclasses import replace

import numpy as np
import oracles_drawing as oracle
import pytest

from diff4splat.data_prep.synthetic.renderer.cameras import render_camera
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.ground_truth.occlusion import visible_points
from diff4splat.data_prep.synthetic.renderer.jit import GROUP, kernel
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.shading.shadows import Chart, lit
from diff4splat.data_prep.synthetic.renderer.shading.tone import byte_thresholds, encoded

SETTINGS = DrawSettings(samples_per_side=1, tracks=0, flow=False, shadow_px=16)


@kernel
def bytes_of(values, thresholds, levels):
    for index in range(len(values)):
        levels[index] = encoded(values[index], thresholds)


@kernel
def light_on(points, normal, heights, chart, shares):
    for at in range(len(points)):
        x, y, z = points[at, 0], points[at, 1], points[at, 2]
        shares[at] = lit(x, y, z, normal, heights, chart, 0.0, 1.0, 0.0)


GROUP.kernels.remove(bytes_of)
GROUP.kernels.remove(light_on)
TEXEL_M = 0.1


def test_display_light_is_encoded_as_srgb_rounded() -> None:
    draw = np.random.default_rng(1)
    x = np.concatenate([draw.uniform(0, 1, 4000), draw.uniform(0, 0.01, 500), [0.0, 1.0]])
    levels = np.zeros(len(x), np.int64)
    bytes_of(x, byte_thresholds(), levels)
    curve = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) * 255
    assert (np.abs(levels - curve) < 0.5 + 1e-3).all()


def wall(far: float, half: float = 90.0) -> object:
    shape = oracle.mesh(
        [[-half, -half, far], [half, -half, far], [half, half, far], [-half, half, far]],
        [[0, 1, 2], [0, 2, 3]],
    )
    look = oracle.texture("plain", 1.0, colors=np.full((2, 3), 0.02))
    return oracle.thing(1, shape, look)


def test_far_surfaces_fade_into_the_horizon() -> None:
    sky = replace(oracle.sky(0.0, 0.05), horizon=np.array([0.05, 0.2, 0.8]))
    near, middle, far = (
        draw_clip(
            oracle.world([wall(far)], [oracle.straight(1, (8, 8))], 1, sky=sky), SETTINGS
        ).views[0].rgb[0].float().mean((0, 1)).numpy()
        for far in (1.0, 15.0, 80.0)
    )  # fmt: skip
    blue = [float(color[2] - color[0]) for color in (near, middle, far)]
    assert blue[0] + 5 < blue[1] < blue[2] - 5


@pytest.mark.parametrize(("behind", "seen"), [(-0.1, True), (2e-5, True), (4e-4, False)])
def test_a_point_is_hidden_from_a_relative_distance_of_1e_4(behind: float, seen: bool) -> None:
    lens = render_camera(oracle.straight(1, (12, 16)), 0)
    shape = wall(2.0).mesh
    u, v = np.meshgrid(np.arange(16) + 0.3, np.arange(12) + 0.8)
    points = np.stack([u.ravel(), v.ravel(), np.full(u.size, 1 / (2.0 * (1 + behind)))], -1)
    found = visible_points(shape.rest, shape.triangles, lens, points, np.full(u.size, -1))
    assert (found == seen).all()


def test_no_point_is_hidden_by_its_own_triangle_or_a_neighbour() -> None:
    lens = render_camera(oracle.straight(1, (12, 16)), 0)
    shape = wall(2.0).mesh
    points = np.array([[8.0, 6.0, 1 / 2.1]])
    for own, seen in ((-1, False), (0, True), (1, True)):
        found = visible_points(shape.rest, shape.triangles, lens, points, np.array([own]))
        assert found.tolist() == [seen]


def shares_of_light(normal: tuple[float, ...], above_m: float) -> np.ndarray:
    """Light on points of a plane through (3, 3, 5), its map of heights ``above_m`` over it."""
    nx, ny, nz = np.array(normal) / np.linalg.norm(normal)
    places = np.random.default_rng(2).uniform(2, 4, (300, 2))

    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 5 - (nx * (x - 3) + ny * (y - 3)) / nz

    middle = (np.arange(64) + 0.5) * TEXEL_M
    heights = height(middle[None], middle[:, None]) + above_m
    points = np.column_stack([places, height(*places.T)])
    shares = np.zeros(len(points))
    chart = Chart(np.eye(3), np.zeros(3), TEXEL_M)
    light_on(points, (float(nx), float(ny), float(nz)), heights, chart, shares)
    return shares


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 1), (1, 1, 1), (-2, 2, 1), (3, 1, 1)])
def test_a_plane_never_shades_itself(normal: tuple) -> None:
    assert (shares_of_light(normal, 0.0) == 1.0).all()


def test_what_is_nearer_than_the_texels_of_the_map_does_not_shade() -> None:
    assert (shares_of_light((0, 0, 1), 1.5 * TEXEL_M) == 1.0).all()
    assert (shares_of_light((0, 0, 1), 1.7 * TEXEL_M) == 0.0).all()
