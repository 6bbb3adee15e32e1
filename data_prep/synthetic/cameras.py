"""Cameras that look at the stage: one input view and its neighbours, each on a path of its own.

A view starts at an eye point and looks at the focus; from there it follows a text of the path
language (``diff4splat.paths.language``). Amplitudes are shares of a near depth of 0.55 of the
distance to the focus.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch

from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.kinds import SceneKind
from diff4splat.data_prep.synthetic.rounding import LENGTH_BITS, LENS_BITS, POSE_BITS
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
_EITHER_WAY = frozenset({"orbit", "arc", "roll", "dolly-zoom"})
_WEIGHTS = {"orbit": 3.0, "arc": 2.0, "forward": 1.5, "roll": 0.5, "dolly-zoom": 0.7}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """Where a view starts, relative to the focus, and how it goes on."""

    azimuth_rad: float
    """0 looks along +z; positive stands further to the right."""
    tilt_rad: float
    distance_m: float
    path: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """What all views of a world share."""

    size_px: tuple[int, int]
    fov_deg: float
    frames: int
    fps: float


def draw_path(draws: Draws, *, may_stand: bool) -> str:
    """A text of the path language."""
    if may_stand and draws.chance(0.15):
        return "static"
    names = list(AMPLITUDES)
    weights = [_WEIGHTS.get(name, 1.0) for name in names]
    count = 2 if draws.chance(0.2) else 1
    chosen: list[str] = []
    while len(chosen) < count:
        name = draws.weighted(names, weights)
        if not any({name, other} <= group for other in chosen for group in _CLASHING):
            chosen.append(name)
    return "+".join(_segment(name, draws) for name in chosen)


_CLASHING = (
    {"forward", "backward"},
    {"left", "right"},
    {"up", "down"},
    {"forward", "dolly-zoom"},
    {"backward", "dolly-zoom"},
    *({name} for name in AMPLITUDES),
)


def _segment(name: str, draws: Draws) -> str:
    low, high = AMPLITUDES[name]
    sign = draws.sign() if name in _EITHER_WAY else 1.0
    return f"{name}:{sign * draws.between(low, high):.3f}"


def draw_shots(kind: SceneKind, lens: Lens, stage_m: float, views: int, draws: Draws) -> list[Shot]:
    """The input view looks along +z; the others stand 10 to 40 degrees aside."""
    half = np.tan(np.radians(lens.fov_deg) / 2)
    distance = float(stage_m * draws.between(0.82, 1.12) / half) + 0.25 * stage_m
    tilt = float(np.radians(draws.between(*kind.tilt_deg)))
    path = draw_path(draws, may_stand=True)
    shots = [Shot(azimuth_rad=0.0, tilt_rad=tilt, distance_m=distance, path=path)]
    side = draws.sign()
    for _ in range(views - 1):
        low = max(tilt - 0.1, 0.05)
        shots.append(
            Shot(
                azimuth_rad=side * float(np.radians(draws.between(10.0, 40.0))),
                tilt_rad=draws.between(low, max(tilt + 0.15, low + 0.05)),
                distance_m=distance * draws.between(0.9, 1.2),
                path=draw_path(draws, may_stand=True),
            )
        )
        side = -side
    return shots


def film(shot: Shot, lens: Lens, focus_height_m: float) -> Camera:
    """The cameras of a shot, float64, on the grid of poses."""
    level = shot.distance_m * np.cos(shot.tilt_rad)
    eye = (
        level * np.sin(shot.azimuth_rad),
        -focus_height_m - shot.distance_m * np.sin(shot.tilt_rad),
        -level * np.cos(shot.azimuth_rad),
    )
    start = rigid.look_at(
        torch.tensor(eye, dtype=torch.float64),
        torch.tensor([0.0, -focus_height_m, 0.0], dtype=torch.float64),
        torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64),
    )
    camera = pinhole(focal_from_fov(lens.fov_deg, lens.size_px[1]), lens.size_px, torch.float64)
    frame = PathFrame(
        camera=camera, near_depth=NEAR_SHARE * shot.distance_m, focus_depth=shot.distance_m
    )
    path = build_path(shot.path, frame, PathSettings(frames=lens.frames, fps=lens.fps))
    poses = start @ path.cameras.world_from_camera
    return _on_grid(path.cameras.with_pose(poses), path.cameras.focal_px)


def _on_grid(cameras: Camera, focal_px: torch.Tensor) -> Camera:
    poses = cameras.world_from_camera
    rotation = torch.round(poses[:, :3, :3] * 2.0**POSE_BITS) * 2.0**-POSE_BITS + 0.0
    position = torch.round(poses[:, :3, 3] * 2.0**LENGTH_BITS) * 2.0**-LENGTH_BITS + 0.0
    focal = torch.round(focal_px * 2.0**LENS_BITS) * 2.0**-LENS_BITS
    return replace(cameras, world_from_camera=rigid.from_parts(rotation, position), focal_px=focal)
