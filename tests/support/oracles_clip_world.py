"""A wall, a box that moves and turns, and a ball, met by rays: the world of ``oracles_clips``.

All in float64 from the formulas: a camera-space direction has z = 1, so the ray parameter of a hit
is the z-depth; a surface point is remembered in its object's own axes, so where it goes is exact.
The upper edge of the wall leaves sky. World axes are those of the first camera of the first view.
"""

from dataclasses import dataclass

import numpy as np

from diff4splat.geometry.camera import Camera

KINDS = ("wall", "box", "ball")
"""In the order of their instances 1, 2, 3; only the box ever moves."""
_WALL_Y = (-1.9, 8.0)
_BOX_HALF = np.array([0.5, 0.6, 0.45])
_BALL_RADIUS = 0.7


@dataclass(frozen=True, slots=True)
class Scene:
    poses: np.ndarray
    """world_from_object, (object, frame, 4, 4)."""
    colors: np.ndarray
    """(object, 3)"""


@dataclass(frozen=True, slots=True)
class Hits:
    """What rays meet; every array has the rays' leading shape."""

    depth: np.ndarray
    which: np.ndarray
    """Object index, −1 for sky."""
    local: np.ndarray
    """The point in its object's axes."""


def pose_at(position: np.ndarray, yaw: float, pitch: float) -> np.ndarray:
    cos, sin = np.cos([yaw, pitch]), np.sin([yaw, pitch])
    about_y = np.array([[cos[0], 0, sin[0]], [0, 1, 0], [-sin[0], 0, cos[0]]])
    about_x = np.array([[1, 0, 0], [0, cos[1], -sin[1]], [0, sin[1], cos[1]]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = about_y @ about_x, position
    return pose


def make_scene(frames: int, static: bool, rng: np.random.Generator) -> Scene:
    shift = rng.uniform(-0.2, 0.2, 3)
    speed, turn = (0.0, 0.0) if static else (0.12, 0.15)
    wall, box, ball = [], [], []
    for frame in range(frames):
        wall.append(pose_at(np.array([0.0, 0.0, 7.0]), 0.25, 0.1))
        moved = np.array([-1.1, 0.4, 4.0]) + shift + frame * speed * np.array([1.0, -0.2, -0.4])
        box.append(pose_at(moved, 0.5 + frame * turn, 0.3 + 0.5 * frame * turn))
        ball.append(pose_at(np.array([1.3, 0.7, 4.8]) - shift, 0.4, 0.0))
    return Scene(np.array([wall, box, ball]), rng.uniform(0.4, 0.9, (3, 3)))


def _meet_box(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    near, far = (-_BOX_HALF - origin) / rays, (_BOX_HALF - origin) / rays
    enter, leave = np.minimum(near, far).max(-1), np.maximum(near, far).min(-1)
    return np.where((enter <= leave) & (enter > 0), enter, np.inf)


def _meet_ball(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    square, half = (rays * rays).sum(-1), (rays * origin).sum(-1)
    inside = half * half - square * ((origin * origin).sum(-1) - _BALL_RADIUS**2)
    first = (-half - np.sqrt(np.maximum(inside, 0))) / square
    return np.where((inside > 0) & (first > 0), first, np.inf)


def _meet_wall(origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    along = -origin[2] / rays[..., 2]
    height = origin[1] + along * rays[..., 1]
    met = (along > 0) & (height > _WALL_Y[0]) & (height < _WALL_Y[1])
    return np.where(met, along, np.inf)


def _cast(scene: Scene, frame: int, origin: np.ndarray, rays: np.ndarray) -> Hits:
    """The first surface along each ray; ``rays`` has a leading shape and 3."""
    along, local = [], []
    for meet, pose in zip((_meet_wall, _meet_box, _meet_ball), scene.poses[:, frame], strict=True):
        start, turned = (origin - pose[:3, 3]) @ pose[:3, :3], rays @ pose[:3, :3]
        with np.errstate(divide="ignore", invalid="ignore"):
            along.append(meet(start, turned))
        local.append(start + np.where(np.isfinite(along[-1]), along[-1], 0)[..., None] * turned)
    which = np.argmin(along, 0)
    depth = np.min(along, 0)
    chosen = np.take_along_axis(np.stack(local), which[None, ..., None], 0)[0]
    return Hits(depth, np.where(np.isfinite(depth), which, -1), chosen)


def see(scene: Scene, camera: Camera, frame: int) -> Hits:
    height, width = camera.size_px
    rows, columns = np.mgrid[:height, :width] + 0.5
    focal, center, pose = _numbers(camera, frame)
    flat = (np.stack([columns, rows], -1) - center) / focal
    rays = np.concatenate([flat, np.ones((height, width, 1))], -1) @ pose[:3, :3].T
    return _cast(scene, frame, pose[:3, 3], rays)


def _numbers(camera: Camera, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    one = camera[frame]
    return one.focal_px.numpy(), one.center_px.numpy(), one.world_from_camera.numpy()


def carried(scene: Scene, which: np.ndarray, local: np.ndarray, frame: int) -> np.ndarray:
    """World positions at ``frame`` of points given in their objects' axes."""
    pose = scene.poses[which, frame]
    return np.einsum("...ij,...j->...i", pose[..., :3, :3], local) + pose[..., :3, 3]


def project_seen(
    scene: Scene, camera: Camera, frame: int, world: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pixel coordinates and whether the camera sees the point: a ray to it meets nothing before."""
    focal, center, pose = _numbers(camera, frame)
    local = (world - pose[:3, 3]) @ pose[:3, :3]
    uv = local[..., :2] / local[..., 2:] * focal + center
    inside = ((uv >= 0) & (uv < np.array(camera.size_px[::-1]))).all(-1) & (local[..., 2] > 0)
    first = _cast(scene, frame, pose[:3, 3], (world - pose[:3, 3]) / local[..., 2:]).depth
    return uv, inside & (first > local[..., 2] * (1 - 1e-9))
