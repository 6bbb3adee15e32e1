"""Depth, instances, flow and visibility against rays that are cast at every triangle."""

import numpy as np
import oracles_drawing as oracle
import pytest
import torch

from diff4splat.data.clip import Clip
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings

SETTINGS = DrawSettings(samples_per_side=2, tracks=40, shadow_px=64)
FRAMES = 3


def moving_soup(seed: int) -> tuple[Clip, list[np.ndarray], torch.Tensor, object]:
    """A clip of two soups, one of which moves and turns; corners of all triangles by frame."""
    still, other = oracle.soup(25, seed), oracle.soup(25, seed + 100, size_m=0.6)
    turns = [np.array([[1, 0, 0.1 * t], [0, 1, 0], [-0.1 * t, 0, 1]]) for t in range(FRAMES)]
    moved = np.stack([other.rest @ turn + 0.1 * t for t, turn in enumerate(turns)])
    camera = oracle.straight(FRAMES)
    drawn = oracle.world(
        [oracle.thing(7, other, positions=moved), oracle.thing(3, still)], [camera], FRAMES
    )
    corners = [
        np.concatenate([still.rest.reshape(-1, 3, 3), moved[t].reshape(-1, 3, 3)])
        for t in range(FRAMES)
    ]
    return draw_clip(drawn, SETTINGS), corners, camera, turns


def nearest(corners: np.ndarray, camera: object, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Depth (0 is nothing) and triangle (−1 is none) of every pixel, no nearer than 1 cm."""
    depth = oracle.cast(corners, *oracle.pixel_rays(camera, frame))
    depth = np.where(depth < 0.01, np.inf, depth)
    found, best = depth.argmin(1), depth.min(1)
    return np.where(np.isfinite(best), best, 0.0), np.where(np.isfinite(best), found, -1)


@pytest.mark.parametrize("seed", range(4))
def test_depth_and_instances_are_those_of_rays(seed: int) -> None:
    clip, corners, camera, _ = moving_soup(seed)
    view = clip.views[0]
    for frame in range(FRAMES):
        depth, found = nearest(corners[frame], camera, frame)
        np.testing.assert_allclose(view.depth[frame].flatten(), depth, rtol=1e-6)
        instances = np.where(found < 0, 0, np.where(found < 25, 3, 7))
        assert (view.instances[frame].flatten().numpy() == instances).all()
    assert 0.2 < (view.depth > 0).float().mean() < 1


@pytest.mark.parametrize("seed", range(4))
def test_flow_is_where_the_surface_goes(seed: int) -> None:
    clip, corners, camera, _ = moving_soup(seed)
    flow = clip.views[0].flow
    assert flow is not None
    assert flow.to_next.shape == (FRAMES - 1, 24, 32, 2)
    for frame in range(FRAMES - 1):
        origin, rays = oracle.pixel_rays(camera, frame)
        depth, found = nearest(corners[frame], camera, frame)
        hit = found >= 0
        shares = barycentric(corners[frame][found[hit]], origin + rays[hit] * depth[hit, None])
        later = (corners[frame + 1][found[hit]] * shares[..., None]).sum(1)
        target, z = oracle.project(camera, frame + 1, later)
        known = flow.known[frame].flatten().numpy()[hit]
        assert (known == (z >= 0.01)).all()
        centers = np.stack(np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5), -1).reshape(-1, 2)
        got = flow.to_next[frame].reshape(-1, 2).numpy()[hit][known]
        want = (target - centers[hit])[known]
        np.testing.assert_allclose(got, want, atol=1e-3, rtol=1e-4)
        inside = (target >= 0).all(1) & (target < [32, 24]).all(1) & known
        seen = inside & ~hidden(corners[frame + 1], camera, frame + 1, target, z, found[hit])
        assert (flow.visible[frame].flatten().numpy()[hit] == seen).mean() > 0.998
    assert flow.visible.any()
    assert not flow.visible.all()


def barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weights of points in the planes of their triangles, by least squares of the normal form."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    away = points - corners[:, 0]
    normal = np.cross(first, second)
    square = (normal**2).sum(-1)
    b = (np.cross(away, second) * normal).sum(-1) / square
    c = (np.cross(first, away) * normal).sum(-1) / square
    return np.stack([1 - b - c, b, c], -1)


def hidden(corners, camera, frame, target, z, own) -> np.ndarray:
    """Whether another triangle is nearer along the ray by more than the tolerance."""
    origin = camera.world_from_camera[frame, :3, 3].numpy()
    depth = oracle.cast(corners, origin, oracle.rays_through(camera, frame, target))
    depth[np.arange(len(own)), own] = np.inf
    return ((depth > 0.01) & (depth * 1.0001 < z[:, None])).any(1)


def test_tracks_are_seen_when_no_triangle_is_in_front() -> None:
    clip, corners, camera, _ = moving_soup(1)
    view = clip.views[0]
    agree = []
    for frame in range(FRAMES):
        points = clip.tracks.positions[frame].double().numpy()
        target, z = oracle.project(camera, frame, points)
        inside = (target >= 0).all(1) & (target < [32, 24]).all(1) & (z > 0.01)
        origin = camera.world_from_camera[frame, :3, 3].numpy()
        depth = oracle.cast(corners[frame], origin, oracle.rays_through(camera, frame, target))
        free = ~((depth > 0.01) & (depth * 1.0005 < z[:, None])).any(1)
        agree.append(view.track_visible[frame].numpy() == (inside & free))
    assert np.mean(agree) > 0.99


def test_the_sky_flows_as_the_camera_turns() -> None:
    camera = oracle.straight(2)
    turn = torch.tensor([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]], dtype=torch.float64)
    camera.world_from_camera[1, :3, :3] = turn
    clip = draw_clip(oracle.world([], [camera], 2), SETTINGS)
    flow = clip.views[0].flow
    _, rays = oracle.pixel_rays(camera, 0)
    local = rays @ turn.numpy()
    target = local[:, :2] / local[:, 2:] * camera.focal_px[0].numpy() + camera.center_px[0].numpy()
    known = flow.known[0].flatten().numpy()
    assert (known == (local[:, 2] >= 0.01)).all()
    got = flow.to_next[0].reshape(-1, 2).numpy()
    centers = np.stack(np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5), -1).reshape(-1, 2)
    np.testing.assert_allclose(got[known], (target - centers)[known], atol=1e-3)
    inside = (target >= 0).all(1) & (target < [32, 24]).all(1) & known
    assert (flow.visible[0].flatten().numpy() == inside).all()


def test_what_is_not_asked_for_is_not_made() -> None:
    settings = DrawSettings(samples_per_side=2, tracks=0, flow=False, shadow_px=16)
    clip = draw_clip(oracle.still_life(2, (8, 8), 1), settings)
    view = clip.views[0]
    assert (view.flow, view.track_uv, view.track_visible, clip.tracks) == (None,) * 4
