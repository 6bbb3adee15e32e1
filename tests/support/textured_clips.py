"""Clips that optical flow and SIFT can work with: textured planes, rendered by intersecting rays.

A slanted background, a nearer board in front, and on request a patch that moves. Depth is exact,
float64 before it is stored; the world frame is that of the first camera.
"""

from dataclasses import replace

import cv2
import numpy as np
import torch

from diff4splat.data.clip import Clip, ClipMetadata, View
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.rays import camera_rays

SIZE_PX = (96, 128)
_TEXELS_PER_UNIT = 64
_SPAN = 24.0
BASELINE = 0.6


def texture(seed: int) -> np.ndarray:
    """Blobs of several sizes, 0 to 255; one unit of length is 64 texels."""
    side = int(_SPAN * _TEXELS_PER_UNIT)
    rng = np.random.default_rng(seed)
    total = np.zeros((side, side, 3), np.float32)
    for cells in (96, 192, 384):
        coarse = rng.uniform(-1, 1, (cells, cells, 3)).astype(np.float32)
        total += cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 70 * total, 0, 255).astype(np.float32)


TEXTURES = [texture(seed) for seed in range(3)]


def straight_path(frames: int, step: float = 0.06) -> Camera:
    """To the right and a little forward, looking ahead."""
    poses = torch.eye(4, dtype=torch.float64).repeat(frames, 1, 1)
    poses[:, 0, 3] = torch.arange(frames) * step
    poses[:, 2, 3] = torch.arange(frames) * step * 0.3
    return pinhole(110.0, SIZE_PX, torch.float64).with_pose(poses)


def textured_view(cameras: Camera, moving: bool = False) -> View:
    """Images, depth and the mask of what moves."""
    frames = [_frame(cameras[n], n * 0.12 if moving else None) for n in range(len(cameras))]
    rgb, depth, mask = (np.stack(each) for each in zip(*frames, strict=True))
    return View(
        rgb=torch.from_numpy(rgb),
        depth=torch.from_numpy(depth),
        cameras=cameras,
        moving=torch.from_numpy(mask) if moving else None,
    )


def textured_clip(
    frames: int = 9, moving: bool = False, stereo: bool = False, identifier: str = "planes"
) -> Clip:
    """A clip with exact depth, static or with a patch that moves."""
    cameras = straight_path(frames)
    views = [textured_view(cameras, moving)]
    if stereo:
        pose = cameras.world_from_camera.clone()
        pose[:, 0, 3] += BASELINE
        views.append(textured_view(cameras.with_pose(pose), moving))
    return Clip(
        note=ClipMetadata(
            identifier=identifier,
            source="textured planes 1",
            dataset="planes",
            scene=identifier,
            license="CC0-1.0",
            metric="exact",
            is_static=not moving,
        ),
        times_s=torch.arange(frames, dtype=torch.float64) / 8,
        views=tuple(views),
    )


def without_depth(clip: Clip) -> Clip:
    """The same clip, of whose depth nothing is known."""
    return replace(clip, views=tuple(replace(view, depth=None) for view in clip.views))


def _frame(camera: Camera, shift: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rays = camera_rays(camera).numpy()
    pose = camera.world_from_camera.numpy()
    directions, origin = rays @ pose[:3, :3].T, pose[:3, 3]
    background = _plane(directions, origin, np.array([0.25, 0.1, 1.0]), 7.0)
    board = _plane(directions, origin, np.array([0.0, 0.05, 1.0]), 4.0)
    patch = _plane(directions, origin, np.array([0.0, 0.0, 1.0]), 3.2)
    rgb, depth = _texels(0, background), background[..., 3]
    inside = (board[..., 0] > 0.2) & (board[..., 0] < 1.6) & (board[..., 1] > -0.4)
    rgb, depth = (
        np.where(inside[..., None], _texels(1, board), rgb),
        np.where(inside, board[..., 3], depth),
    )
    moving = np.zeros(depth.shape, bool)
    if shift is not None:
        patch[..., 1] -= shift
        moving = (np.abs(patch[..., 0] + 0.6) < 0.5) & (np.abs(patch[..., 1] + 0.4) < 0.4)
        rgb = np.where(moving[..., None], _texels(2, patch), rgb)
        depth = np.where(moving, patch[..., 3], depth)
    return rgb.round().astype(np.uint8), depth.astype(np.float32), moving


def _plane(directions: np.ndarray, origin: np.ndarray, normal: np.ndarray, distance: float):
    """World point and z where rays meet n · x = distance."""
    z = (distance - normal @ origin) / (directions @ normal)
    return np.concatenate([origin + directions * z[..., None], z[..., None]], -1)


def _texels(number: int, points: np.ndarray) -> np.ndarray:
    places = ((points[..., :2] + _SPAN / 2) * _TEXELS_PER_UNIT).astype(np.float32)
    return cv2.remap(
        TEXTURES[number],
        places[..., 0],
        places[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_WRAP,
    )
