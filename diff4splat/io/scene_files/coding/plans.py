"""Which tensors of a scene are coded, and with which steps.

Axes: ``n`` Gaussians, ``m`` moving ones, ``t`` key times, ``k`` harmonics, ``w`` colour waves.
A tolerance in pixels becomes one in scene units by the distance to the nearest camera of the path.
"""

import numpy as np
from jaxtyping import Float, Int

from diff4splat.io.scene_files.coding.coded_tensors import Plan
from diff4splat.io.scene_files.compression import Tolerances
from diff4splat.paths.camera_path import CameraPath
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene

CAMERAS = 16
"""Of the path, spread over it; more would change little."""
LEAST_DISTANCE = 0.02
"""Of the median distance: what lies nearer to a camera is not stored more exactly."""
LARGEST_ANGLE_RAD = 0.02
"""Even of Gaussians that are small in every image."""
SH_DC = 0.28209479177387814
COMPONENTS_PER_ANGLE = 1 / 5
"""An error of e in three components of a quaternion turns by less than 5 e."""


def plan_tensors(scene: Scene, tolerances: Tolerances) -> dict[str, Plan]:
    """The plan of every tensor that is coded, by its name in the file."""
    pixel = units_per_pixel(scene)
    plans = _gaussian_plans(scene, tolerances, pixel)
    motion = scene.motion
    if not len(motion.moving_index):
        return plans  # A motion that moves nothing is stored as static.
    plans["moving_index"] = Plan(steps=np.ones((1, 1)), columns=1)
    if isinstance(motion, KeyframeMotion):
        plans |= _keyframe_plans(scene, motion, tolerances, pixel)
    if isinstance(motion, SpacetimeMotion):
        plans |= _spacetime_plans(scene, motion, tolerances, pixel)
    if isinstance(motion, HexPlaneMotion):
        plans |= _field_plans(motion, tolerances)
        if motion.rotation == "additive":
            del plans["quats"]  # their lengths matter there
    return plans


def units_per_pixel(scene: Scene) -> Float[np.ndarray, " n"]:
    """The size of a pixel where each Gaussian is, for the nearest camera of the path."""
    means = scene.gaussians.means.detach().cpu().double().numpy()
    distance = np.full(len(means), np.inf)
    for points in (means, *_moved(scene, means)):
        distance = np.minimum(distance, _distance(points, scene.path))
    least = LEAST_DISTANCE * float(np.median(distance)) if len(distance) else 0.0
    focal_px = float(scene.path.cameras.focal_px.max())
    return np.maximum(distance, max(least, 1e-30)) / focal_px


def _moved(scene: Scene, means: np.ndarray) -> list[np.ndarray]:
    """Positions at the key times."""
    motion = scene.motion
    if not isinstance(motion, KeyframeMotion):
        return []
    index, moved = motion.moving_index.cpu().numpy(), []
    for offset in motion.offsets.detach().cpu().double().numpy():
        moved.append(means.copy())
        moved[-1][index] += offset
    return moved


def _distance(points: Float[np.ndarray, "n 3"], path: CameraPath) -> Float[np.ndarray, " n"]:
    centers = path.cameras.world_from_camera[:, :3, 3].detach().cpu().double().numpy()
    chosen = np.linspace(0, len(centers) - 1, min(CAMERAS, len(centers))).round().astype(int)
    nearest = np.full(len(points), np.inf)
    for center in centers[np.unique(chosen)]:
        offset = points - center
        nearest = np.minimum(nearest, np.einsum("ni,ni->n", offset, offset))
    return np.sqrt(nearest)


def _gaussian_plans(
    scene: Scene, tolerances: Tolerances, pixel: Float[np.ndarray, " n"]
) -> dict[str, Plan]:
    harmonics = scene.gaussians.sh.shape[1]
    return {
        "means": _positions(tolerances, pixel),
        "quats": _rotations(scene, tolerances, pixel),
        "scales": _even(tolerances.log_scale, 3, "log"),
        "opacities": _even(tolerances.opacity, 1, "probability"),
        "sh": _colors(tolerances, harmonics),
    }


def _keyframe_plans(
    scene: Scene, motion: KeyframeMotion, tolerances: Tolerances, pixel: Float[np.ndarray, " n"]
) -> dict[str, Plan]:
    keys, index = len(motion.key_times_s), motion.moving_index.cpu().numpy()
    return {
        "offsets": _positions(tolerances, np.tile(pixel[index], keys)),
        "rotations": _rotations(scene, tolerances, pixel, np.tile(index, keys)),
        "log_scale_offsets": _even(tolerances.log_scale, 3),
    }


def _spacetime_plans(
    scene: Scene, motion: SpacetimeMotion, tolerances: Tolerances, pixel: Float[np.ndarray, " n"]
) -> dict[str, Plan]:
    """Velocities by where they lead while a pulse lasts; its centre as a share of its length."""
    start_s, stop_s = motion.time_range_s
    deviations = motion.time_deviations_s.detach().cpu().double().numpy()
    lasting_s = np.minimum(3 * deviations, max(stop_s - start_s, 1e-6))
    at = pixel[motion.moving_index.cpu().numpy()]
    speed = np.linalg.norm(motion.velocities.detach().cpu().double().numpy(), axis=-1)
    center_s = np.minimum(
        tolerances.opacity * lasting_s, tolerances.position_px * at / np.maximum(speed, 1e-30)
    )
    plans = {
        "velocities": _positions(tolerances, at / lasting_s),
        "time_centers_s": Plan(steps=2 * center_s[:, None], columns=1),
        "time_deviations_s": _even(tolerances.log_scale, 1, "log"),
    }
    if motion.color_waves is not None:
        _, waves, harmonics, _ = motion.color_waves.shape
        one = _colors(tolerances, harmonics)
        columns = waves * one.columns
        plans["color_waves"] = Plan(steps=np.tile(one.steps, waves), columns=columns)
    return plans


def _field_plans(motion: HexPlaneMotion, tolerances: Tolerances) -> dict[str, Plan]:
    plans = {}
    for name, tensor in motion.tensors().items():
        largest = float(tensor.detach().abs().max()) if tensor.numel() else 0.0
        step = 2 * tolerances.field * largest or 1.0
        plans[f"hexplane.{name}"] = Plan(steps=np.full((1, 1), step), columns=tensor.shape[-1])
    return plans


def _positions(tolerances: Tolerances, pixel: Float[np.ndarray, " r"]) -> Plan:
    # An error of one axis is at most that of the position, over the root of 3.
    return Plan(steps=2 / np.sqrt(3) * tolerances.position_px * pixel[:, None], columns=3)


def _rotations(
    scene: Scene,
    tolerances: Tolerances,
    pixel: Float[np.ndarray, " n"],
    index: Int[np.ndarray, " r"] | slice = slice(None),
) -> Plan:
    longest = scene.gaussians.scales.detach().cpu().double().amax(-1).numpy()
    angle = tolerances.rotation_px * pixel / np.maximum(longest, 1e-30)
    component = 2 * COMPONENTS_PER_ANGLE * np.minimum(angle, LARGEST_ANGLE_RAD)[index]
    # The first column is a number from 0 to 3, which must come back exactly.
    steps = np.stack([np.ones_like(component), component, component, component], -1)
    return Plan(steps=steps, columns=4, transform="smallest_three")


def _colors(tolerances: Tolerances, harmonics: int) -> Plan:
    """No harmonic is larger than about 1, but the constant one, which is 0.28."""
    steps = np.full((1, 3 * harmonics), 2 * tolerances.color)
    steps[:, :3] /= SH_DC
    return Plan(steps=steps, columns=3 * harmonics)


def _even(tolerance: float, columns: int, transform: str = "value") -> Plan:
    return Plan(steps=np.full((1, 1), 2 * tolerance), columns=columns, transform=transform)
