"""Scenes with their true depth and images along a camera path, one NumPy file each.

Arrays: ``rgb`` (h w 3) in bytes; ``depth`` z (h w) at the image's size, ``depth_518`` at 518 px, 0
where there is no surface; ``views`` (v h w 3) in bytes; ``world_from_camera`` (v 4 4) relative to
the first camera, in scene units: the median true depth is 4. ``fov_deg`` is horizontal.
"""

import argparse
from typing import Any

import numpy as np
import torch

from benchmarks.out_of_domain.rendering import depth_z, photographs, tonemapped
from benchmarks.out_of_domain.scenes import random_scene
from diff4splat.generation.inputs.input_cameras import to_camera_path
from diff4splat.geometry.camera import focal_from_fov, pinhole
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH

PRIOR_SIDE_PX = 518
"""Of the depth maps that common depth networks give."""
SAMPLES = {"rgb": 48, "depth": 1}
MITSUBA_FROM_OPENCV = np.diag([-1.0, -1.0, 1.0, 1.0])
"""Mitsuba's x points left, its y up."""


def render_views(arguments: argparse.Namespace) -> None:
    """Render ``arguments.images`` scenes; files that exist are kept."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    textures = photographs()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for index in range(arguments.images):
        file = arguments.out / f"{index:04d}.npz"
        if not file.exists():
            np.savez_compressed(file, **_scene_arrays(index, arguments, textures))
            print(f"{index + 1}/{arguments.images}", flush=True)


def _scene_arrays(
    index: int, arguments: argparse.Namespace, textures: list[np.ndarray]
) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([arguments.seed, index])
    scene = random_scene(rng, textures, arguments.side)
    sensor = scene["sensor"]
    first = np.asarray(sensor["to_world"].matrix, dtype=np.float64)
    rgb, depth = _view(scene, first, arguments.side, "rgb", index)
    depth_518 = _view(scene, first, PRIOR_SIDE_PX, "depth", index)[1]
    poses = path_poses(sensor["fov"], arguments.side, arguments.path, arguments.views)
    metres = float(np.median(depth_518[depth_518 > 0])) / PLANE_DEPTH
    views = [
        _view(scene, moved(first, pose, metres), arguments.side, "rgb", 1000 * index + number)[0]
        for number, pose in enumerate(poses, 1)
    ]
    return {
        "rgb": rgb, "depth": depth, "depth_518": depth_518, "views": np.stack(views),
        "world_from_camera": poses, "fov_deg": np.float64(sensor["fov"]),
    }  # fmt: skip


def path_poses(fov_deg: float, side_px: int, path: str, views: int) -> np.ndarray:
    """``views`` poses spread over a path, without its first one."""
    camera = pinhole(focal_from_fov(fov_deg, side_px), (side_px, side_px))
    poses = to_camera_path(path, camera).cameras.world_from_camera.double()
    chosen = torch.linspace(0, len(poses) - 1, views + 1).round().long()[1:]
    return poses[chosen].numpy()


def moved(first: np.ndarray, pose: np.ndarray, metres: float) -> np.ndarray:
    """Mitsuba's camera at a pose relative to the ``first``, whose unit has so many ``metres``."""
    relative = pose.copy()
    relative[:3, 3] *= metres
    return first @ MITSUBA_FROM_OPENCV @ relative @ MITSUBA_FROM_OPENCV


def _view(
    scene: dict[str, Any], to_world: np.ndarray, side_px: int, what: str, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Image in bytes and depth z."""
    import mitsuba

    film = scene["sensor"]["film"] | {"width": side_px, "height": side_px}
    sampler = {"type": "independent", "sample_count": SAMPLES[what]}
    sensor = scene["sensor"] | {"film": film, "sampler": sampler}
    sensor["to_world"] = mitsuba.ScalarTransform4f(to_world)
    layers = np.array(mitsuba.render(mitsuba.load_dict(scene | {"sensor": sensor}), seed=seed))
    rgb = np.round(255 * tonemapped(layers[..., :3])).astype(np.uint8)
    return rgb, depth_z(layers[..., -1], float(sensor["fov"]))
