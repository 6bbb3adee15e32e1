"""Relative pose errors of camera steps estimated from rendered images.

Axes: ``h w`` pixels, ``t`` frames. SIFT points of one image, matched with cross-check, are
unprojected with its rendered depth. The next camera pose is estimated from their pixels in the next
image (PnP with RANSAC, then least squares). The paper compares the cameras of a scene with
themselves, which gives 0 by construction; here images must have the parallax of their cameras.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.records import Score, score
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import to_bytes
from diff4splat.metrics.pose import PathError, path_error
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render_video
from diff4splat.render.settings import RenderOutput, RenderSettings
from diff4splat.scene.scene import Scene

MIN_MATCHES = 12
"""Twice the six points that determine a pose, so that errors are detectable."""
INLIER_PX = 1.5
RANSAC_ROUNDS = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class StepErrors:
    """Errors of the estimated steps, and the number of failed ones."""

    translation: tuple[float, ...]
    """Scene units."""
    rotation_deg: tuple[float, ...]
    failed: int


def pose_entries(row: str, scene: Scene, path: CameraPath) -> Entries:
    """Relative pose errors of a path, from its rendered images."""
    errors = step_errors(scene, path)
    failed = errors.failed / (len(path) - 1)
    return [
        score(row, "pose_translation", errors.translation),
        score(row, "pose_rotation", errors.rotation_deg),
        Score(row=row, key="pose_failed", value=round(failed, 6)),
    ]


def step_errors(scene: Scene, path: CameraPath) -> StepErrors:
    """Compare every estimated step with the true one."""
    translation, rotation, failed = [], [], 0
    # Protocols measure larger images than the scene's own, without closing what lies between.
    settings = RenderSettings(dilation_px2=scene.dilation_px2)
    frames = list(render_video(scene, path, outputs=("rgb", "depth"), settings=settings))
    for index in range(len(path) - 1):
        pair = (path.cameras[index], path.cameras[index + 1])
        step = recover_step(frames[index], frames[index + 1], pair)
        if step is None:
            failed += 1
            continue
        error = _step_error(step, pair)
        translation.append(error.relative_translation)
        rotation.append(error.relative_rotation_deg)
    return StepErrors(translation=tuple(translation), rotation_deg=tuple(rotation), failed=failed)


def recover_step(
    first: RenderOutput, second: RenderOutput, cameras: tuple[Camera, Camera]
) -> Float[Tensor, "4 4"] | None:
    """Estimate ``second_from_first`` from two images and the first depth; None if it fails."""
    first_px, second_px = _matches(to_bytes(first.rgb), to_bytes(second.rgb))
    points, pixels = _unproject_matches(first.depth, cameras[0], first_px, second_px)
    if len(points) < MIN_MATCHES:
        return None
    intrinsics = _intrinsic_matrix(cameras[1])
    cv2.setRNGSeed(0)
    success, axis_angle, translation, inliers = cv2.solvePnPRansac(
        points, pixels, intrinsics, None, iterationsCount=RANSAC_ROUNDS, reprojectionError=INLIER_PX
    )
    if not success or inliers is None or len(inliers) < MIN_MATCHES:
        return None
    kept = inliers[:, 0]
    axis_angle, translation = cv2.solvePnPRefineLM(
        points[kept], pixels[kept], intrinsics, None, axis_angle, translation
    )
    rotation = torch.from_numpy(cv2.Rodrigues(axis_angle)[0])
    return rigid.from_parts(rotation, torch.from_numpy(translation[:, 0]))


def _step_error(second_from_first: Float[Tensor, "4 4"], pair: tuple[Camera, Camera]) -> PathError:
    """Error of an estimated step, without alignment."""
    estimated = torch.stack([torch.eye(4).double(), rigid.invert(second_from_first)])
    truth = torch.stack([camera.world_from_camera.double() for camera in pair])
    return path_error(estimated, truth, "none")


def _matches(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixel coordinates (x, y) of points matched in both images; pixel centres at +0.5."""
    detector = cv2.SIFT_create()
    keypoints = [
        detector.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
        for image in (first, second)
    ]
    if any(features is None or len(features) < 2 for _, features in keypoints):
        return np.zeros((0, 2)), np.zeros((0, 2))
    matcher = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)
    pairs = matcher.match(keypoints[0][1], keypoints[1][1])
    first_px = np.array([keypoints[0][0][pair.queryIdx].pt for pair in pairs]).reshape(-1, 2)
    second_px = np.array([keypoints[1][0][pair.trainIdx].pt for pair in pairs]).reshape(-1, 2)
    # OpenCV has integer coordinates at pixel centres.
    return first_px + 0.5, second_px + 0.5


def _unproject_matches(
    depth: Float[Tensor, "h w"], camera: Camera, first_px: np.ndarray, second_px: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points at ``first_px`` in the first camera frame, and their pixels in the second image."""
    height, width = depth.shape
    columns = np.clip(first_px[:, 0].astype(int), 0, width - 1)
    rows = np.clip(first_px[:, 1].astype(int), 0, height - 1)
    z = depth.double().numpy()[rows, columns]
    camera = camera.to(torch.float64)
    slopes = (first_px - camera.center_px.numpy()) / camera.focal_px.numpy()
    points = np.concatenate([slopes, np.ones((len(slopes), 1))], -1) * z[:, None]
    valid = z > 0
    return points[valid], second_px[valid]


def _intrinsic_matrix(camera: Camera) -> np.ndarray:
    fx, fy = camera.focal_px.tolist()
    cx, cy = camera.center_px.tolist()
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
