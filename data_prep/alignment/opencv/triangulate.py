"""Points from matches and cameras, float64. Axes: ``m`` matches; (x, y) in pixels."""

import cv2
import numpy as np
from jaxtyping import Bool, Float64

from diff4splat.geometry.camera import Camera

MOST_ERROR_PX, LEAST_ANGLE_DEG = 2.0, 1.0


def triangulate(
    first: Camera, second: Camera, uv: Float64[np.ndarray, "2 m 2"]
) -> tuple[Float64[np.ndarray, "m 3"], Bool[np.ndarray, " m"]]:
    """World points, and which are reliable: in front, reprojected well, seen under an angle."""
    cameras = (first, second)
    matrices = [camera.camera_from_world.double().numpy()[:3] for camera in cameras]
    rays = [normalised(camera, places) for camera, places in zip(cameras, uv, strict=True)]
    points = cv2.triangulatePoints(*matrices, rays[0].T.copy(), rays[1].T.copy())
    weight = np.where(np.abs(points[3]) > 1e-12, points[3], 1e-12)
    world = (points[:3] / weight).T
    good = _angle_deg(world, cameras) > LEAST_ANGLE_DEG
    for camera, places in zip(cameras, uv, strict=True):
        error, z = reprojection(camera, world, places)
        good &= (z > 0) & (error < MOST_ERROR_PX)
    return world, good


def normalised(camera: Camera, uv: Float64[np.ndarray, "m 2"]) -> Float64[np.ndarray, "m 2"]:
    """Image coordinates at z = 1."""
    return (uv - camera.center_px.double().numpy()) / camera.focal_px.double().numpy()


def reprojection(
    camera: Camera, world: Float64[np.ndarray, "m 3"], uv: Float64[np.ndarray, "m 2"]
) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
    """Distance to ``uv`` in pixels, and z."""
    pose = camera.camera_from_world.double().numpy()
    local = world @ pose[:3, :3].T + pose[:3, 3]
    z = local[:, 2]
    safe = np.where(np.abs(z) > 1e-12, z, 1e-12)
    there = local[:, :2] / safe[:, None] * camera.focal_px.double().numpy()
    return np.linalg.norm(there + camera.center_px.double().numpy() - uv, axis=1), z


def _angle_deg(world: np.ndarray, cameras: tuple[Camera, Camera]) -> np.ndarray:
    rays = [world - camera.position.double().numpy() for camera in cameras]
    rays = [ray / np.linalg.norm(ray, axis=1, keepdims=True).clip(1e-12) for ray in rays]
    # By the chord: the arc cosine of nearly 1 has no digits left.
    chord = np.linalg.norm(rays[0] - rays[1], axis=1).clip(0, 2)
    return np.degrees(2 * np.arcsin(chord / 2))
