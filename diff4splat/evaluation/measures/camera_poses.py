"""Relative pose errors of camera steps estimated from rendered images.

Axes: ``h w`` pixels, ``t`` frames. SIFT points of one image, matched with cross-check, are
unprojected with its rendered depth. The next camera pose is estimated from their pixels in the next
image (PnP with RANSAC, then least squares). The paper compares the cameras of a scene with
themselves, which gives 0 by construction; here images must have the parallax of their cameras.
Steps compare neighbouring frames. The asked path compares every frame with the first one.
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
MIN_LENGTH = 0.1
"""Shortest translation that has a relative error, as a share of the longest of its path."""
RANSAC_ROUNDS = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class StepErrors:
    """Errors of the estimated steps, and the number of failed ones."""

    translation: tuple[float, ...]
    """Scene units."""
    rotation_deg: tuple[float, ...]
    failed: int
    relative: tuple[float, ...] = ()
    """Translation errors over the lengths of the true translations, where these are not short."""
    matches: tuple[float, ...] = ()
    """Points of the first image found where its depth puts them in the second; 0 if it failed."""


def pose_entries(row: str, scene: Scene, path: CameraPath) -> Entries:
    """Pose errors of a path, from its rendered images."""
    frames = rendered_frames(scene, path)
    steps, asked = step_errors(frames, path), path_errors(frames, path)
    failed = [errors.failed / (len(path) - 1) for errors in (steps, asked)]
    return [
        score(row, "pose_translation", steps.translation),
        score(row, "pose_rotation", steps.rotation_deg),
        Score(row=row, key="pose_failed", value=round(failed[0], 6)),
        score(row, "camera_translation", asked.relative),
        score(row, "camera_rotation", asked.rotation_deg),
        Score(row=row, key="camera_failed", value=round(failed[1], 6)),
        score(row, "pose_matches", steps.matches),
    ]


def rendered_frames(scene: Scene, path: CameraPath) -> list[RenderOutput]:
    """Images and depth along a path."""
    # Protocols measure larger images than the scene's own, without closing what lies between.
    settings = RenderSettings(dilation_px2=scene.dilation_px2)
    return list(render_video(scene, path, outputs=("rgb", "depth"), settings=settings))


def step_errors(frames: list[RenderOutput], path: CameraPath) -> StepErrors:
    """Compare every estimated step with the true one."""
    return _pose_errors(frames, path, [(index, index + 1) for index in range(len(path) - 1)])


def path_errors(frames: list[RenderOutput], path: CameraPath) -> StepErrors:
    """Compare every estimated pose, relative to the first frame, with the asked one."""
    return _pose_errors(frames, path, [(0, index) for index in range(1, len(path))])


def _pose_errors(
    frames: list[RenderOutput], path: CameraPath, pairs: list[tuple[int, int]]
) -> StepErrors:
    found, matches, lengths = [], [], []
    for first, second in pairs:
        cameras = (path.cameras[first], path.cameras[second])
        step = recover_step(frames[first], frames[second], cameras)
        matches.append(0.0 if step is None else float(step.matches))
        lengths.append(float((cameras[1].position - cameras[0].position).norm()))
        if step is not None:
            found.append((_step_error(step.pose, cameras), lengths[-1]))
    # Of the whole path: where it returns, a length is rounding, and an error over it anything.
    shortest = MIN_LENGTH * max(lengths)
    return StepErrors(
        translation=tuple(error.relative_translation for error, _ in found),
        rotation_deg=tuple(error.relative_rotation_deg for error, _ in found),
        failed=len(pairs) - len(found),
        relative=tuple(e.relative_translation / length for e, length in found if length > shortest),
        matches=tuple(matches),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveredPose:
    """A pose from two images."""

    pose: Float[Tensor, "4 4"]
    """``second_from_first``"""
    matches: int
    """Points that agree with it."""


def recover_step(
    first: RenderOutput, second: RenderOutput, cameras: tuple[Camera, Camera]
) -> RecoveredPose | None:
    """Estimate a pose from two images and the first depth; None if it fails."""
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
    pose = rigid.from_parts(rotation, torch.from_numpy(translation[:, 0]))
    return RecoveredPose(pose=pose, matches=len(kept))


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
