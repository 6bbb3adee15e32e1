"""Given depth on the grids that a generation needs.

Axes: ``h w`` pixels of the image, ``y x`` of the copy that networks see.
"""

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.given_depth.anchor import AnchoredDepth, anchor
from diff4splat.generation.given_depth.source import DepthSource
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.geometry.camera import Camera
from diff4splat.progress.run_log import RunLog

EDGE = 0.03
"""Difference of log depth beyond which neighbours are two surfaces."""


def given_depth(source: DepthSource, image: InputImage, log: RunLog) -> Float[Tensor, "h w"]:
    """Depth z of every pixel in scene units; what was done goes into the log's ``depth``."""
    found = source.depth_map(image)
    tangents = ray_tangents(image.camera, found.values.shape)
    anchored = anchor(found.values, found.kind, tangents)
    log.depth.update(source.record() | {"kind": found.kind} | depth_record(anchored))
    depth = resized_depth(anchored.depth, image.camera.size_px)
    return torch.from_numpy(depth).to(image.rgb)


def depth_record(anchored: AnchoredDepth) -> dict[str, object]:
    """How the unit and the offset were found."""
    record: dict[str, object] = {"metres_per_unit": anchored.metres_per_unit}
    if anchored.offset is not None:
        record |= {"infinity": anchored.offset.infinity, "offset_by": anchored.offset.why}
    return record


def ray_tangents(camera: Camera, size_px: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """x/z of the columns and y/z of the rows of a grid over the camera's image."""
    centers, focals = camera.center_px.tolist(), camera.focal_px.tolist()
    found = []
    for axis, center, focal in zip((1, 0), centers, focals, strict=True):
        pixels = (np.arange(size_px[axis]) + 0.5) / size_px[axis] * camera.size_px[axis]
        found.append((pixels - center) / focal)
    return found[0], found[1]


def resized_depth(depth: np.ndarray, size_px: tuple[int, ...]) -> np.ndarray:
    """Depth at another size: linear in inverse depth on surfaces, the nearest value at edges."""
    if depth.shape == tuple(size_px):
        return depth
    to, inverse = size_px[::-1], (1 / depth).astype(np.float32)
    shrinks = size_px[0] < depth.shape[0]
    nearest = cv2.resize(inverse, to, interpolation=cv2.INTER_NEAREST_EXACT)
    smooth = cv2.resize(inverse, to, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    is_edge = np.abs(np.log(smooth / nearest)) > EDGE
    return (1 / np.where(is_edge, nearest, smooth)).astype(np.float32)


def reduced_depth(depth: Float[Tensor, "h w"], size_px: tuple[int, int]) -> Float[Tensor, "y x"]:
    """The same for the copy, whose cells are means of inverse depth."""
    factor = depth.shape[0] // size_px[0]
    return 1 / torch.nn.functional.avg_pool2d(1 / depth[None, None], factor)[0, 0]
