"""Dense disparity of a posed video from DIS flow: a stand-in where no depth network has run.

A pixel with ray r (z = 1) and inverse depth ρ is seen by another camera along R r + ρ t, so every
flow gives ρ by one division. Pixels that move by themselves get wrong values, as with any
triangulation; those that disagree with the epipolar line get none. Axes: ``t`` frames, ``h w``.
"""

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from diff4splat.data.clip import View
from diff4splat.data_prep.alignment.opencv.dis_flow import flow_pair
from diff4splat.geometry.camera import Camera
from diff4splat.geometry.rays import camera_rays

_GAPS = (1, 2, 4, 8)
_OFF_LINE_PX = 1.5
_LEAST_PARALLAX_PX = 0.5
_MEDIAN_SIDE_PX = 5


def flow_disparity(view: View) -> Float32[np.ndarray, "t h w"]:
    """Inverse depth in the units of the poses; 0 where flow does not give one."""
    rgb, frames = view.rgb.numpy(), len(view.rgb)
    found = []
    for here in range(frames):
        others = [here + gap for gap in _GAPS if here + gap < frames]
        others += [here - gap for gap in _GAPS if here - gap >= 0]
        best = np.zeros(rgb.shape[1:3])
        weight = np.zeros(rgb.shape[1:3])
        for other in others:
            value, parallax = _of_pair(view.cameras, (here, other), rgb)
            better = parallax > weight
            best, weight = np.where(better, value, best), np.where(better, parallax, weight)
        found.append(cv2.medianBlur(best.astype(np.float32), _MEDIAN_SIDE_PX))
    return np.stack(found)


def _of_pair(
    cameras: Camera, pair: tuple[int, int], rgb: UInt8[np.ndarray, "t h w 3"]
) -> tuple[Float64[np.ndarray, "h w"], Float64[np.ndarray, "h w"]]:
    """Inverse depth, and the parallax in pixels that supports it; both 0 where unknown."""
    first, second = (cameras[number] for number in pair)
    flow = flow_pair(rgb[pair[0]], rgb[pair[1]])
    move = (second.camera_from_world @ first.world_from_camera).numpy()
    turned = camera_rays(first).numpy() @ move[:3, :3].T
    focal, center = second.focal_px.numpy(), second.center_px.numpy()
    height, width = rgb.shape[1:3]
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1) + 0.5
    seen = (grid + flow.forward - center) / focal
    along = move[:2, 3] - seen * move[2, 3]
    target = seen * turned[..., 2:] - turned[..., :2]
    strength = (along**2).sum(-1)
    inverse = (target * along).sum(-1) / np.maximum(strength, 1e-12)
    off_line = np.linalg.norm(target - inverse[..., None] * along, axis=-1) * focal.mean()
    parallax = inverse * np.sqrt(strength) * focal.mean()
    good = flow.consistent & (off_line < _OFF_LINE_PX) & (parallax > _LEAST_PARALLAX_PX)
    return np.where(good, inverse, 0), np.where(good, parallax, 0)
