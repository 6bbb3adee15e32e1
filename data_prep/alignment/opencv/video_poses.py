"""Camera poses of a plain video of a mostly static scene, without weights.

SIFT matches of two frames give an essential matrix (MAGSAC++) and points; further frames are
registered to the points, and new points are triangulated where too few are left. Lengths are
arbitrary: the median depth of the first points is 1. A stand-in: slow motion, no loop closure.
Axes: ``t`` frames.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import UInt8

from diff4splat.data_prep.alignment.opencv.matches import (
    Features,
    epipolar_matches,
    matches,
    sift_features,
)
from diff4splat.data_prep.alignment.opencv.triangulate import normalised, triangulate
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera

_FEWEST_INLIERS = 20
_LEAST_SHIFT = 0.03
"""Median displacement of the first pair over the diagonal: less has no reliable depth."""
_RENEW_BELOW = 150
"""Registered points below which new ones are triangulated."""


@dataclass(slots=True)
class _Map:
    """What is known so far: one frame with features, their points, and all poses."""

    features: Features
    points: np.ndarray
    """(n, 3) world; NaN where unknown."""
    camera: Camera


def video_poses(rgb: UInt8[np.ndarray, "t h w 3"], lens: Camera) -> Camera:
    """A batch of cameras, the first at the origin; ``lens`` has the intrinsics.

    Raises:
        InputError: the camera does not move enough, or a frame cannot be registered; names it.
    """
    features = [sift_features(frame) for frame in rgb]
    start, known = _first_points(features, lens)
    poses = [np.eye(4)]
    for number in range(1, len(rgb)):
        pose, inliers = _registered(known, features[number], lens, number)
        poses.append(pose)
        if inliers < _RENEW_BELOW and number > start:
            known = _renewed(known, features[number], _at(lens, pose))
    return lens.with_pose(torch.from_numpy(np.stack(poses)))


def _first_points(features: list[Features], lens: Camera) -> tuple[int, _Map]:
    diagonal = float(np.hypot(*lens.size_px))
    for number in range(1, len(features)):
        pairs = epipolar_matches(features[0], features[number])
        uv = _places(features[0], features[number], pairs)
        if not len(pairs):
            break
        if np.median(np.linalg.norm(uv[1] - uv[0], axis=1)) < _LEAST_SHIFT * diagonal:
            continue
        found = _two_views(features[0], uv, pairs, lens)
        if found is not None:
            return number, found
    raise InputError(
        "poses: expected a camera that moves through a textured scene, got too little parallax; "
        "estimate poses with COLMAP or MegaSaM"
    )


def _two_views(first: Features, uv: np.ndarray, pairs: np.ndarray, lens: Camera) -> _Map | None:
    rays = [normalised(lens, places) for places in uv]
    focal = float(lens.focal_px.mean())
    essential, _ = cv2.findEssentialMat(
        *rays, np.eye(3), method=cv2.USAC_MAGSAC, prob=0.999, threshold=1 / focal
    )
    if essential is None or essential.shape != (3, 3):
        return None
    _, rotation, translation, _ = cv2.recoverPose(essential, *rays, np.eye(3))
    second = np.eye(4)
    second[:3, :3], second[:3, 3] = rotation.T, -rotation.T @ translation[:, 0]
    world, good = triangulate(lens, _at(lens, second), uv)
    if good.sum() < _FEWEST_INLIERS:
        return None
    points = np.full((len(first.uv), 3), np.nan)
    points[pairs[good, 0]] = world[good] / np.median(world[good, 2])
    return _Map(features=first, points=points, camera=lens)


def _registered(known: _Map, seen: Features, lens: Camera, number: int) -> tuple[np.ndarray, int]:
    pairs = matches(known.features, seen)
    pairs = pairs[np.isfinite(known.points[pairs[:, 0]]).all(1)]
    inliers = np.zeros(0)
    if len(pairs) >= _FEWEST_INLIERS:
        world, rays = known.points[pairs[:, 0]], normalised(lens, seen.uv[pairs[:, 1]])
        limit = 2 / float(lens.focal_px.mean())
        found, rotation, translation, inliers = cv2.solvePnPRansac(
            world, rays, np.eye(3), None, reprojectionError=limit, iterationsCount=500
        )
        inliers = inliers[:, 0] if found and inliers is not None else np.zeros(0)
    if len(inliers) < _FEWEST_INLIERS:
        raise InputError(
            f"poses, frame {number}: expected {_FEWEST_INLIERS} points of earlier frames or more, "
            f"got {len(inliers)}; the motion may be too fast, or there is a cut"
        )
    rotation, translation = cv2.solvePnPRefineLM(
        world[inliers], rays[inliers], np.eye(3), None, rotation, translation
    )
    turn = cv2.Rodrigues(rotation)[0]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn.T, -turn.T @ translation[:, 0]
    return pose, len(inliers)


def _renewed(known: _Map, seen: Features, camera: Camera) -> _Map:
    """Points of the features of a new frame, or the known ones if too few can be triangulated."""
    pairs = epipolar_matches(known.features, seen)
    uv = _places(known.features, seen, pairs)
    world, good = triangulate(known.camera, camera, uv)
    if good.sum() < _RENEW_BELOW // 2:
        return known
    points = np.full((len(seen.uv), 3), np.nan)
    old = matches(known.features, seen)
    points[old[:, 1]] = known.points[old[:, 0]]
    fresh = np.isnan(points[pairs[:, 1]]).any(1) & good
    points[pairs[fresh, 1]] = world[fresh]
    return _Map(features=seen, points=points, camera=camera)


def _places(first: Features, second: Features, pairs: np.ndarray) -> np.ndarray:
    return np.stack([first.uv[pairs[:, 0]], second.uv[pairs[:, 1]]])


def _at(lens: Camera, pose: np.ndarray) -> Camera:
    return lens.with_pose(torch.from_numpy(pose))
