"""The camera's steps as they can be recovered from rendered pictures.

Axes: ``h w`` pixels, ``t`` frames. Points of one picture (SIFT, matched both ways) get their place
in space from its rendered depth, and the next camera is found from where they appear there (PnP in
RANSAC, then refined by least squares). The paper compares a scene's cameras with themselves, which
is 0 by construction; here pictures must show the parallax that their cameras claim.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.picture_measures import Entries
from diff4splat.evaluation.records import Score, score
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import to_bytes
from diff4splat.metrics.pose import PathError, path_error
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.api import render_video
from diff4splat.render.settings import RenderOutput
from diff4splat.scene.scene import Scene

LEAST_MATCHES = 12
"""Six points fix a pose; twice as many tell when they disagree."""
INLIER_PX = 1.5
RANSAC_ROUNDS = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class StepErrors:
    """Of the steps that were recovered, and how many were not."""

    translation: tuple[float, ...]
    """Scene units."""
    rotation_deg: tuple[float, ...]
    failed: int


def pose_entries(row: str, scene: Scene, path: CameraPath) -> Entries:
    """Relative pose errors of a path through its pictures."""
    errors = step_errors(scene, path)
    failed = errors.failed / (len(path) - 1)
    return [
        score(row, "pose_translation", errors.translation),
        score(row, "pose_rotation", errors.rotation_deg),
        Score(row=row, key="pose_failed", value=round(failed, 6)),
    ]


def step_errors(scene: Scene, path: CameraPath) -> StepErrors:
    """Compare every recovered step with the true one."""
    translation, rotation, failed = [], [], 0
    frames = list(render_video(scene, path, outputs=("rgb", "depth")))
    for index in range(len(path) - 1):
        pair = (path.cameras[index], path.cameras[index + 1])
        step = recovered_step(frames[index], frames[index + 1], pair)
        if step is None:
            failed += 1
            continue
        error = _compared(step, pair)
        translation.append(error.relative_translation)
        rotation.append(error.relative_rotation_deg)
    return StepErrors(translation=tuple(translation), rotation_deg=tuple(rotation), failed=failed)


def recovered_step(
    first: RenderOutput, second: RenderOutput, cameras: tuple[Camera, Camera]
) -> Float[Tensor, "4 4"] | None:
    """``second_from_first`` from the pictures and the first one's depth; None if it fails."""
    here, there = _matches(to_bytes(first.rgb), to_bytes(second.rgb))
    points, pixels = _in_space(first.depth, cameras[0], here, there)
    if len(points) < LEAST_MATCHES:
        return None
    lens = _lens(cameras[1])
    cv2.setRNGSeed(0)
    found, turn, shift, inliers = cv2.solvePnPRansac(
        points, pixels, lens, None, iterationsCount=RANSAC_ROUNDS, reprojectionError=INLIER_PX
    )
    if not found or inliers is None or len(inliers) < LEAST_MATCHES:
        return None
    kept = inliers[:, 0]
    turn, shift = cv2.solvePnPRefineLM(points[kept], pixels[kept], lens, None, turn, shift)
    rotation = torch.from_numpy(cv2.Rodrigues(turn)[0])
    return rigid.from_parts(rotation, torch.from_numpy(shift[:, 0]))


def _compared(second_from_first: Float[Tensor, "4 4"], pair: tuple[Camera, Camera]) -> PathError:
    """A recovered step against the true one, without aligning anything."""
    estimated = torch.stack([torch.eye(4).double(), rigid.invert(second_from_first)])
    truth = torch.stack([camera.world_from_camera.double() for camera in pair])
    return path_error(estimated, truth, "none")


def _matches(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixel coordinates (x, y), centres at +0.5, of points seen in both pictures."""
    finder = cv2.SIFT_create()
    found = [
        finder.detectAndCompute(cv2.cvtColor(one, cv2.COLOR_RGB2GRAY), None)
        for one in (first, second)
    ]
    if any(features is None or len(features) < 2 for _, features in found):
        return np.zeros((0, 2)), np.zeros((0, 2))
    matcher = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)
    pairs = matcher.match(found[0][1], found[1][1])
    here = np.array([found[0][0][pair.queryIdx].pt for pair in pairs]).reshape(-1, 2)
    there = np.array([found[1][0][pair.trainIdx].pt for pair in pairs]).reshape(-1, 2)
    # OpenCV puts whole numbers at pixel centres.
    return here + 0.5, there + 0.5


def _in_space(
    depth: Float[Tensor, "h w"], camera: Camera, here: np.ndarray, there: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the first camera's space behind ``here``, and where the second one sees them."""
    height, width = depth.shape
    columns = np.clip(here[:, 0].astype(int), 0, width - 1)
    rows = np.clip(here[:, 1].astype(int), 0, height - 1)
    z = depth.double().numpy()[rows, columns]
    own = camera.to(torch.float64)
    flat = (here - own.center_px.numpy()) / own.focal_px.numpy()
    points = np.concatenate([flat, np.ones((len(flat), 1))], -1) * z[:, None]
    seen = z > 0
    return points[seen], there[seen]


def _lens(camera: Camera) -> np.ndarray:
    fx, fy = camera.focal_px.tolist()
    cx, cy = camera.center_px.tolist()
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
