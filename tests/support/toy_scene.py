"""The truth behind all written data sets: one analytic world, filmed by one or two eyes.

Everything is OpenCV and float64, in a world that is nobody's camera. What is sky has depth inf.
"""

from dataclasses import dataclass

import numpy as np
import torch
from oracles_clip_world import Scene, carried, make_scene, pose_at, project_seen, see

from diff4splat.geometry.camera import Camera

WORLD = pose_at(np.array([3.0, -2.0, 5.0]), 0.7, -0.4)
"""Puts the first camera somewhere."""


@dataclass(frozen=True)
class Eye:
    """What one camera saw."""

    poses: np.ndarray
    """world_from_camera, (t, 4, 4)."""
    lens: np.ndarray
    """(fx, fy, cx, cy), centres at +0.5."""
    rgb: np.ndarray
    depth: np.ndarray
    which: np.ndarray
    """Object, -1 for sky."""
    forward: np.ndarray
    """Flow to the next frame, (t - 1, h, w, 2); NaN for sky."""
    backward: np.ndarray
    """Flow to the previous frame, of frames 1 to t - 1."""
    forward_seen: np.ndarray


@dataclass(frozen=True)
class Truth:
    """Everything that formats store."""

    eyes: tuple[Eye, ...]
    positions: np.ndarray
    """Points on surfaces, (t, n, 3) in the world."""
    uv: np.ndarray
    """Their pixels in the first eye."""
    visible: np.ndarray

    @property
    def left(self) -> Eye:
        return self.eyes[0]

    @property
    def frames(self) -> int:
        return len(self.left.poses)

    @property
    def size_px(self) -> tuple[int, int]:
        return self.left.depth.shape[1:]


def make_truth(
    size_px: tuple[int, int],
    lens: tuple[float, float, float, float],
    baseline_m: float = 0.0,
    static: bool = False,
    frames: int = 4,
    tracks: int = 40,
) -> Truth:
    """One eye, or two where there is a base line; ``static`` stops the box that moves."""
    rng = np.random.default_rng(5)
    scene = make_scene(frames, static, rng)
    starts = [
        pose_at(np.array([0.05 * t, -0.3 + 0.03 * t, 0.06 * t]), 0.02 * t, 0.01 * t)
        for t in range(frames)
    ]
    local = np.stack(starts)
    eyes = []
    for shift in (0.0, baseline_m) if baseline_m else (0.0,):
        poses = local.copy()
        poses[:, :3, 3] += shift * poses[:, :3, 0]
        eyes.append(_eye(scene, _camera(poses, lens, size_px)))
    positions, uv, visible = _points(scene, _camera(local, lens, size_px), eyes[0], tracks, rng)
    return Truth(tuple(eyes), _moved(positions), uv, visible)


def _camera(poses: np.ndarray, lens: tuple[float, ...], size_px: tuple[int, int]) -> Camera:
    numbers = torch.tensor(lens, dtype=torch.float64).expand(len(poses), 4)
    return Camera(
        focal_px=numbers[:, :2],
        center_px=numbers[:, 2:],
        world_from_camera=torch.from_numpy(poses),
        size_px=size_px,
    )


def _moved(positions: np.ndarray) -> np.ndarray:
    return positions @ WORLD[:3, :3].T + WORLD[:3, 3]


def _eye(scene: Scene, camera: Camera) -> Eye:
    hits = [see(scene, camera, t) for t in range(len(camera))]
    seen = [_flow(scene, camera, hit, t + 1) for t, hit in enumerate(hits[:-1])]
    back = [_flow(scene, camera, hit, t)[0] for t, hit in enumerate(hits[1:])]
    return Eye(
        poses=WORLD @ camera.world_from_camera.numpy(),
        lens=np.concatenate([camera.focal_px[0].numpy(), camera.center_px[0].numpy()]),
        rgb=np.stack([_colors(hit) for hit in hits]),
        depth=np.stack([hit.depth for hit in hits]),
        which=np.stack([hit.which for hit in hits]),
        forward=np.stack([flow for flow, _ in seen]),
        backward=np.stack(back),
        forward_seen=np.stack([visible for _, visible in seen]),
    )


def _colors(hits) -> np.ndarray:
    wave = np.sin(hits.local * np.array([5.0, 6.0, 7.0])).prod(-1, keepdims=True)
    base = np.array([[0.8, 0.5, 0.4], [0.4, 0.7, 0.5], [0.5, 0.4, 0.8], [0.6, 0.7, 0.9]])
    color = base[hits.which] * (0.7 + 0.3 * np.where(hits.which[..., None] < 0, 1, wave))
    return np.round(color * 255).astype(np.uint8)


def _flow(scene: Scene, camera: Camera, hits, frame: int) -> tuple[np.ndarray, np.ndarray]:
    height, width = camera.size_px
    rows, columns = np.mgrid[:height, :width] + 0.5
    world = carried(scene, hits.which, hits.local, frame)
    uv, sees = project_seen(scene, camera, frame, world)
    flow = uv - np.stack([columns, rows], -1)
    flow[hits.which < 0] = np.nan
    return flow, sees & (hits.which >= 0)


def _points(scene: Scene, camera: Camera, eye: Eye, count: int, rng: np.random.Generator):
    hits = see(scene, camera, 0)
    places = np.argwhere(hits.which >= 0)
    chosen = places[rng.choice(len(places), count, replace=False)]
    which = hits.which[tuple(chosen.T)]
    local = hits.local[tuple(chosen.T)]
    positions, uv, visible = [], [], []
    for frame in range(len(camera)):
        world = carried(scene, which, local, frame)
        pixels, sees = project_seen(scene, camera, frame, world)
        positions.append(world)
        uv.append(pixels)
        visible.append(sees)
    return np.stack(positions), np.stack(uv), np.stack(visible)
