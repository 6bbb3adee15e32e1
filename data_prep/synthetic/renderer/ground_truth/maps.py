"""Ground truth at pixel centres: depth, instances and flow.

Axes: ``h w`` pixels, ``p`` = h · w. All three come from the triangle and the barycentric weights at
the centre, so they agree with each other to rounding.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32, UInt8

from diff4splat.data_prep.synthetic.renderer.cameras import RenderCamera, sample_grid, to_camera
from diff4splat.data_prep.synthetic.renderer.ground_truth.occlusion import visible_points
from diff4splat.data_prep.synthetic.renderer.jit import kernel
from diff4splat.data_prep.synthetic.renderer.rasterise import NEAR_M, blank, rasterise, weights
from diff4splat.data_prep.synthetic.renderer.triangle_buffer import TriangleBuffer


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundTruth:
    """Ground truth of one view at one time."""

    triangles: Int32[np.ndarray, "h w"]
    """Index of the visible triangle; −1 is sky."""
    depth: Float32[np.ndarray, "h w"]
    instances: UInt8[np.ndarray, "h w"]
    to_next: Float32[np.ndarray, "h w 2"] | None = None
    known: Bool[np.ndarray, "h w"] | None = None
    visible: Bool[np.ndarray, "h w"] | None = None


def render_ground_truth(
    buffer: TriangleBuffer, frame: int, lens: RenderCamera, following: RenderCamera | None
) -> GroundTruth:
    """Ground truth of a frame; ``following`` is the camera at the next frame, for flow."""
    local, grid = camera_vertices(buffer, frame, lens), sample_grid(lens, 1)
    closest, triangle_map = blank(lens.height, lens.width)
    rasterise(
        local, buffer.triangles, 0, len(buffer.triangles), grid, NEAR_M, closest, triangle_map
    )
    shape = (lens.height, lens.width)
    depth, instances = np.zeros(shape, np.float32), np.zeros(shape, np.uint8)
    read_pixels(
        triangle_map,
        grid,
        local,
        buffer.triangles,
        buffer.owners,
        buffer.instances,
        depth,
        instances,
    )
    if following is None:
        return GroundTruth(triangles=triangle_map, depth=depth, instances=instances)
    later = camera_vertices(buffer, frame + 1, following)
    targets = np.zeros((depth.size, 3))
    next_frame_positions(
        triangle_map, grid, lens, following, local, later, buffer.triangles, targets
    )
    triangle_of_pixel = triangle_map.reshape(-1).astype(np.int64)
    visible_next = visible_points(later, buffer.triangles, following, targets, triangle_of_pixel)
    known = targets[:, 2] >= 0
    to_next = np.where(known[:, None], targets[:, :2] - _centers(shape), 0.0)
    return GroundTruth(
        triangles=triangle_map,
        depth=depth,
        instances=instances,
        to_next=to_next.astype(np.float32).reshape(*shape, 2),
        known=known.reshape(shape),
        visible=visible_next.reshape(shape),
    )


def camera_vertices(
    buffer: TriangleBuffer, frame: int, lens: RenderCamera
) -> Float64[np.ndarray, "v 3"]:
    """All vertices in camera axes."""
    local = np.empty_like(buffer.rest)
    to_camera(buffer.positions[frame], lens, local)
    return local


def _centers(shape: tuple[int, int]) -> Float64[np.ndarray, "p 2"]:
    rows, columns = np.indices(shape)
    return np.stack([columns.reshape(-1) + 0.5, rows.reshape(-1) + 0.5], -1)


@kernel
def read_pixels(triangle_map, grid, local, triangles, owners, instances, depth, instance_map):
    """Depth and instance of every pixel covered by a triangle."""
    for row in range(triangle_map.shape[0]):
        for column in range(triangle_map.shape[1]):
            index = triangle_map[row, column]
            if index >= 0:
                x, y = grid.x[0, column], grid.y[row]
                a, b, c = weights(local, triangles, index, x, y)
                i, j, k = triangles[index, 0], triangles[index, 1], triangles[index, 2]
                depth[row, column] = local[i, 2] * a + local[j, 2] * b + local[k, 2] * c
                instance_map[row, column] = instances[owners[index]]


@kernel
def next_frame_positions(triangle_map, grid, lens, following, local, later, triangles, targets):
    """Position (u, v, 1/z) of the surface of every pixel in the next frame; 1/z = −1 if behind it.

    The sky is infinitely far away: it turns with the camera and has 1/z = 0.
    """
    width = triangle_map.shape[1]
    for row in range(triangle_map.shape[0]):
        for column in range(width):
            index = triangle_map[row, column]
            x, y = grid.x[0, column], grid.y[row]
            if index >= 0:
                a, b, c = weights(local, triangles, index, x, y)
                i, j, k = triangles[index, 0], triangles[index, 1], triangles[index, 2]
                px = later[i, 0] * a + later[j, 0] * b + later[k, 0] * c
                py = later[i, 1] * a + later[j, 1] * b + later[k, 1] * c
                pz = later[i, 2] * a + later[j, 2] * b + later[k, 2] * c
            else:
                before, after = lens.rotation, following.rotation
                wx = before[0, 0] * x + before[0, 1] * y + before[0, 2]
                wy = before[1, 0] * x + before[1, 1] * y + before[1, 2]
                wz = before[2, 0] * x + before[2, 1] * y + before[2, 2]
                px = after[0, 0] * wx + after[1, 0] * wy + after[2, 0] * wz
                py = after[0, 1] * wx + after[1, 1] * wy + after[2, 1] * wz
                pz = after[0, 2] * wx + after[1, 2] * wy + after[2, 2] * wz
            place = row * width + column
            targets[place, 2] = -1.0
            if pz >= NEAR_M:
                targets[place, 0] = px / pz * following.focal[0] + following.center[0]
                targets[place, 1] = py / pz * following.focal[1] + following.center[1]
                targets[place, 2] = 1.0 / pz if index >= 0 else 0.0
