"""Matched points of a posed clip as sparse depth, where its poses have a scale worth keeping."""

import numpy as np
from jaxtyping import Float32

from diff4splat.data.clip import Clip
from diff4splat.data_prep.alignment.opencv.matches import epipolar_matches, sift_features
from diff4splat.data_prep.alignment.opencv.triangulate import reprojection, triangulate
from diff4splat.data_prep.alignment.references.reference import Reference, aligned_metric
from diff4splat.data_prep.alignment.references.track_depth import splat_depth
from diff4splat.errors import InputError
from diff4splat.geometry.camera import Camera

_GAPS = (2, 5, 10)
"""Frames between two images of one view; short ones match well, long ones have an angle."""


def triangulation_reference(clip: Clip) -> Reference:
    """Depth of matched points between frames of the input view, and between views at one time.

    Raises:
        InputError: nothing could be triangulated.
    """
    rgb = clip.views[0].rgb.numpy()
    cameras = clip.views[0].cameras
    features = [sift_features(frame) for frame in rgb]
    found: list[list[np.ndarray]] = [[] for _ in rgb]
    for gap in _GAPS:
        for here in range(len(rgb) - gap):
            there = here + gap
            pair = _points((cameras[here], cameras[there]), (features[here], features[there]))
            for frame, points in zip((here, there), pair, strict=True):
                found[frame].append(points)
    for view in clip.views[1:]:
        for frame, image in enumerate(view.rgb.numpy()):
            both = (cameras[frame], view.cameras[frame])
            found[frame].append(_points(both, (features[frame], sift_features(image)))[0])
    depth = np.stack([_map(points, clip.size_px) for points in found])
    if not depth.any():
        raise InputError(
            "reference triangulation: expected matches under an angle, got none; the camera may "
            "stand still or its poses may be wrong"
        )
    return Reference(depth=depth, name="triangulation", metric=aligned_metric(clip.note.metric))


def _points(cameras: tuple[Camera, Camera], features: tuple) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) u, v and z in each of both images."""
    pairs = epipolar_matches(*features)
    uv = np.stack([each.uv[pairs[:, side]] for side, each in enumerate(features)])
    if not len(pairs):
        return np.zeros((0, 3)), np.zeros((0, 3))
    world, good = triangulate(*cameras, uv)
    z = [reprojection(camera, world, places)[1] for camera, places in zip(cameras, uv, strict=True)]
    return tuple(np.c_[places, depth][good] for places, depth in zip(uv, z, strict=True))


def _map(points: list[np.ndarray], size_px: tuple[int, int]) -> Float32[np.ndarray, "h w"]:
    every = np.concatenate([np.zeros((0, 3)), *points])
    return splat_depth(every[:, :2], every[:, 2], size_px)
