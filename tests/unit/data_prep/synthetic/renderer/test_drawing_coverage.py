"""No cracks, no leaks, edges averaged as their area says, and what crosses the camera's plane."""

import numpy as np
import oracles_drawing as oracle
import pytest
import torch

from diff4splat.data_prep.synthetic.renderer.cameras import render_camera, sample_grid
from diff4splat.data_prep.synthetic.renderer.rasterise import NEAR_M, blank, rasterise
from diff4splat.data_prep.synthetic.world import Mesh


def owners(mesh: Mesh, size_px=(20, 30), per_side: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Triangle and 1/z of every sample, seen from the origin along z."""
    lens = render_camera(oracle.straight(1, size_px), 0)
    grid = sample_grid(lens, per_side)
    closest, found = blank(size_px[0] * per_side, size_px[1] * per_side)
    rasterise(mesh.rest, mesh.triangles, 0, len(mesh.triangles), grid, NEAR_M, closest, found)
    return found, closest


def test_a_closed_room_has_no_cracks() -> None:
    room = oracle.sphere((0.1, 0.2, 0.3), 3.0, rows=30)
    found, _ = owners(room, (60, 60))
    assert (found >= 0).all()


@pytest.mark.parametrize("per_side", [1, 2, 4])
def test_a_tessellated_plane_is_covered_whole(per_side: int) -> None:
    draw = np.random.default_rng(3)
    plane = oracle.ground(30.0, 40)
    spread = plane.rest + draw.uniform(-0.3, 0.3, plane.rest.shape) * [1, 0, 1]
    upright = np.stack([spread[:, 0], spread[:, 2], 4.0 + 0 * spread[:, 0]], -1)
    found, closest = owners(oracle.mesh(upright, plane.triangles), per_side=per_side)
    assert (found >= 0).all()
    np.testing.assert_allclose(1 / closest, 4.0, rtol=1e-9)


def test_vertices_that_fall_on_samples_leave_no_holes() -> None:
    plane = oracle.ground(1.0, 8)
    upright = np.stack([plane.rest[:, 0], plane.rest[:, 2] - 4, 2 + 0 * plane.rest[:, 0]], -1)
    camera = oracle.straight(1, (16, 16))
    upright[:, :2] *= 2 / float(camera.focal_px[0, 0]) * 8
    found, _ = owners(oracle.mesh(upright, plane.triangles), (16, 16), 1)
    assert (found >= 0).all()


@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0, -2.5])
def test_an_edge_covers_what_its_area_says(slope: float) -> None:
    side = np.array([[-50.0, -50.0 * slope, 1], [50.0, 50.0 * slope, 1], [0, 200.0, 1]])
    side[:, 1] += 0.013
    found, _ = owners(oracle.mesh(side, [[0, 1, 2]]), (32, 32))
    share = (found >= 0).reshape(32, 4, 32, 4).mean((1, 3))
    y, x = (np.indices((32 * 32, 32 * 32)) + 0.5) / 32 - 16
    inside = y > slope * x + 0.013 * 0.9 * 32
    exact = inside.reshape(32, 32, 32, 32).mean((1, 3))
    assert np.abs(share - exact).max() < 0.14
    assert abs(share.mean() - exact.mean()) < 2e-3


def test_triangles_across_the_camera_plane_are_cut_there() -> None:
    floor = oracle.mesh(
        [[-90, 1, -50], [90, 1, -50], [90, 1, 90], [-90, 1, 90]], [[0, 1, 2], [0, 2, 3]]
    )
    found, closest = owners(floor, (30, 30), 1)
    y = (np.arange(30) + 0.5 - 15) / 27
    reached = np.broadcast_to((y > 1 / 90)[:, None], (30, 30))
    assert ((found >= 0) == reached).mean() > 0.98
    np.testing.assert_allclose(closest[20:], np.broadcast_to(y[20:, None], (10, 30)), rtol=1e-9)


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0, -1], [1, 0, -1], [0, 1, -1]],
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [[0, 0, 0.005], [1, 0, 0.005], [0, 1, 0.005]],
        [[0, 0, 2], [0, 0, 2], [0, 0, 2]],
        [[-1, -1, 2], [0, 0, 2], [1, 1, 2]],
        [[0, 0, 1], [0, 0, 2], [0, 0, 3]],
        [[1e9, 0, 1], [1e9, 1, 1], [2e9, 0, 1]],
    ],
    ids=["behind", "on the plane", "too near", "a point", "a line", "edge on", "far aside"],
)
def test_what_cannot_be_seen_is_not_drawn(corners: list) -> None:
    found, closest = owners(oracle.mesh(corners, [[0, 1, 2]]))
    assert (found == -1).all()
    assert (closest == 0).all()


def test_of_two_equal_triangles_the_first_wins() -> None:
    twice = [[-9, -9, 2], [9, -9, 2], [0, 9, 2]]
    found, _ = owners(oracle.mesh(twice + twice, [[0, 1, 2], [3, 4, 5]]))
    assert set(np.unique(found)) == {0}


def test_samples_of_a_pixel_share_no_row_and_no_column() -> None:
    grid = sample_grid(render_camera(oracle.straight(1, (4, 4)), 0), 4)
    x = np.stack([grid.x[j % 4, :4] for j in range(4)])
    y = grid.y[:4, None] + grid.bend[None, :4]
    assert len(np.unique(x.round(9))) == len(np.unique(y.round(9))) == 16
    assert isinstance(torch.from_numpy(x), torch.Tensor)
