"""Camera paths of a world: the input view and its neighbours, each on a separate path.

A view starts at an eye point and looks at the focus. From there it follows a path in the path
language (``diff4splat.paths.language``). Amplitudes are shares of a near depth of 0.55 of the
distance to the focus.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from diff4splat.data_prep.synthetic.layout.kinds import SceneKind
from diff4splat.data_prep.synthetic.quantise import LENGTH_BITS, LENS_BITS, POSE_BITS
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera, focal_from_fov, pinhole
from diff4splat.paths.build import build_path
from diff4splat.paths.settings import PathFrame, PathSettings

NEAR_SHARE = 0.55
AMPLITUDES: dict[str, tuple[float, float]] = {
    "orbit": (0.02, 0.065),
    "arc": (0.12, 0.35),
    "spiral": (0.06, 0.13),
    "figure8": (0.08, 0.16),
    "forward": (0.15, 0.42),
    "backward": (0.15, 0.4),
    "up": (0.08, 0.2),
    "down": (0.05, 0.12),
    "left": (0.08, 0.22),
    "right": (0.08, 0.22),
    "roll": (0.015, 0.04),
    "dolly-zoom": (0.12, 0.3),
}
_SIGNED = frozenset({"orbit", "arc", "roll", "dolly-zoom"})
_WEIGHTS = {"orbit": 3.0, "arc": 2.0, "forward": 1.5, "roll": 0.5, "dolly-zoom": 0.7}


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewSpec:
    """Start pose of a view relative to the focus, and its path."""

    azimuth_rad: float
    """0 looks along +z; positive is further to the right."""
    tilt_rad: float
    distance_m: float
    path: str
    focus_m: tuple[float, float, float] | None = None
    """Point the view looks at; None is the centre of the area, at the height of all views."""
    roll_rad: float = 0.0
    fov_deg: float | None = None
    """None is that of all views."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LensSpec:
    """Image size, field of view and timing of all views."""

    size_px: tuple[int, int]
    fov_deg: float
    frames: int
    fps: float


def sample_path(rng: Rng, *, may_be_static: bool) -> str:
    """Sample a path in the path language."""
    if may_be_static and rng.bernoulli(0.15):
        return "static"
    names = list(AMPLITUDES)
    weights = [_WEIGHTS.get(name, 1.0) for name in names]
    count = 2 if rng.bernoulli(0.2) else 1
    names_used: list[str] = []
    while len(names_used) < count:
        name = rng.weighted_choice(names, weights)
        if not any({name, other} <= group for other in names_used for group in _EXCLUSIVE):
            names_used.append(name)
    return "+".join(_segment(name, rng) for name in names_used)


_EXCLUSIVE = (
    {"forward", "backward"},
    {"left", "right"},
    {"up", "down"},
    {"forward", "dolly-zoom"},
    {"backward", "dolly-zoom"},
    *({name} for name in AMPLITUDES),
)


def _segment(name: str, rng: Rng) -> str:
    low, high = AMPLITUDES[name]
    sign = rng.sign() if name in _SIGNED else 1.0
    return f"{name}:{sign * rng.uniform(low, high):.3f}"


def sample_views(
    kind: SceneKind, lens: LensSpec, area_radius_m: float, views: int, rng: Rng
) -> list[ViewSpec]:
    """The input view looks along +z; the others are 10 to 40 degrees to the side."""
    half = np.tan(np.radians(lens.fov_deg) / 2)
    distance = float(area_radius_m * rng.uniform(0.82, 1.12) / half) + 0.25 * area_radius_m
    tilt = float(np.radians(rng.uniform(*kind.tilt_deg)))
    path = sample_path(rng, may_be_static=True)
    specs = [ViewSpec(azimuth_rad=0.0, tilt_rad=tilt, distance_m=distance, path=path)]
    side = rng.sign()
    for _ in range(views - 1):
        low = max(tilt - 0.1, 0.05)
        specs.append(
            ViewSpec(
                azimuth_rad=side * float(np.radians(rng.uniform(10.0, 40.0))),
                tilt_rad=rng.uniform(low, max(tilt + 0.15, low + 0.05)),
                distance_m=distance * rng.uniform(0.9, 1.2),
                path=sample_path(rng, may_be_static=True),
            )
        )
        side = -side
    return specs


def camera_batch(view: ViewSpec, lens: LensSpec, focus_height_m: float) -> Camera:
    """The cameras of a view, float64, quantised."""
    start = _start_pose(view, view.focus_m or (0.0, -focus_height_m, 0.0))
    fov_deg = view.fov_deg or lens.fov_deg
    camera = pinhole(focal_from_fov(fov_deg, lens.size_px[1]), lens.size_px, torch.float64)
    frame = PathFrame(
        camera=camera, near_depth=NEAR_SHARE * view.distance_m, focus_depth=view.distance_m
    )
    path = build_path(view.path, frame, PathSettings(frames=lens.frames, fps=lens.fps))
    poses = start @ path.cameras.world_from_camera
    return _quantised(path.cameras.with_pose(poses), path.cameras.focal_px)


def _start_pose(view: ViewSpec, focus_m: tuple[float, float, float]) -> torch.Tensor:
    """Pose that looks at the focus; roll turns it around its axis."""
    level = view.distance_m * np.cos(view.tilt_rad)
    offset = (
        level * np.sin(view.azimuth_rad),
        -view.distance_m * np.sin(view.tilt_rad),
        -level * np.cos(view.azimuth_rad),
    )
    focus = torch.tensor(focus_m, dtype=torch.float64)
    down = torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64)
    pose = rigid.look_at(focus + torch.tensor(offset, dtype=torch.float64), focus, down)
    if view.roll_rad == 0.0:
        return pose
    cos, sin = np.cos(view.roll_rad), np.sin(view.roll_rad)
    turn = torch.tensor([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    return rigid.from_parts(pose[:3, :3] @ turn, pose[:3, 3])


def _quantised(cameras: Camera, focal_px: torch.Tensor) -> Camera:
    poses = cameras.world_from_camera
    rotation = torch.round(poses[:, :3, :3] * 2.0**POSE_BITS) * 2.0**-POSE_BITS + 0.0
    position = torch.round(poses[:, :3, 3] * 2.0**LENGTH_BITS) * 2.0**-LENGTH_BITS + 0.0
    focal = torch.round(focal_px * 2.0**LENS_BITS) * 2.0**-LENS_BITS
    return replace(cameras, world_from_camera=rigid.from_parts(rotation, position), focal_px=focal)
