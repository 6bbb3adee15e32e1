"""SIFT features and matches that one epipolar geometry explains (MAGSAC++).

Lowe, "Distinctive Image Features from Scale-Invariant Keypoints" (2004); Barath et al., "MAGSAC++"
(2020), as OpenCV has them. Axes: ``n`` features, ``m`` matches; (x, y) in pixels, centres at +0.5.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

_MOST_FEATURES = 2000
_CONTRAST = 0.02
_RATIO = 0.8
_INLIER_PX = 1.0
_FEWEST = 15
"""Matches below which an epipolar geometry proves nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Features:
    """Points of one image."""

    uv: Float64[np.ndarray, "n 2"]
    descriptors: Float32[np.ndarray, "n 128"]


def sift_features(image: UInt8[np.ndarray, "h w 3"]) -> Features:
    """Up to 2000 points with descriptors."""
    sift = cv2.SIFT_create(nfeatures=_MOST_FEATURES, contrastThreshold=_CONTRAST)
    points, descriptors = sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
    uv = np.array([point.pt for point in points], np.float64).reshape(-1, 2) + 0.5
    if descriptors is None:
        descriptors = np.zeros((0, 128), np.float32)
    return Features(uv=uv, descriptors=descriptors)


def matches(first: Features, second: Features) -> Int64[np.ndarray, "m 2"]:
    """Indices of mutual nearest neighbours that are far better than the second best."""
    forward, backward = _nearest(first, second), _nearest(second, first)
    pairs = [(i, j) for i, j in forward.items() if backward.get(j) == i]
    return np.array(pairs, np.int64).reshape(-1, 2)


def epipolar_matches(first: Features, second: Features) -> Int64[np.ndarray, "m 2"]:
    """Those of ``matches`` that MAGSAC++ keeps; none if too few agree."""
    pairs = matches(first, second)
    if len(pairs) < _FEWEST:
        return pairs[:0]
    _, inliers = cv2.findFundamentalMat(
        first.uv[pairs[:, 0]], second.uv[pairs[:, 1]], cv2.USAC_MAGSAC, _INLIER_PX, 0.999, 10_000
    )
    if inliers is None or inliers.sum() < _FEWEST:
        return pairs[:0]
    return pairs[inliers[:, 0].astype(bool)]


def _nearest(first: Features, second: Features) -> dict[int, int]:
    if len(first.uv) < 2 or len(second.uv) < 2:
        return {}
    found = cv2.BFMatcher(cv2.NORM_L2).knnMatch(first.descriptors, second.descriptors, k=2)
    return {
        best.queryIdx: best.trainIdx
        for best, next_best in found
        if best.distance < _RATIO * next_best.distance
    }
