"""Places moving objects so that they are well visible in the input view.

A heading is relative to the input camera at the first frame: right is its x axis on the ground,
away its viewing direction. The measured displacement must match the heading.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float64

from diff4splat.captions.vocabulary import OPPOSITE
from diff4splat.data_prep.synthetic.layout.floor_plan import FloorPlan, PlacedObject
from diff4splat.data_prep.synthetic.layout.props import shape_of_size
from diff4splat.data_prep.synthetic.motions.context import MotionContext, PartPositions
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS, Motion
from diff4splat.data_prep.synthetic.object_sampler import ObjectSampler
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.surfaces.surface import about_y
from diff4splat.geometry.camera import Camera, project

Direction = str
HEADINGS: dict[Direction, tuple[float, float]] = {
    "left": (-1.0, 0.0),
    "right": (1.0, 0.0),
    "toward": (0.0, -1.0),
    "away": (0.0, 1.0),
}
"""(right, away) relative to the input camera."""
REVERSED_SHARES = (1.0, 0.7, 0.5)
"""Shares of the displacement, tried in this order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageArea:
    """The area of the moving objects, and the input view."""

    radius_m: float
    times_s: Float64[np.ndarray, " t"]
    camera: Camera
    """The input view."""
    distance_m: float
    plan: FloorPlan
    sampler: ObjectSampler
    against_share: float = 0.0
    """Share of travelling objects that move against what their position and orientation suggest."""

    @property
    def width_m(self) -> float:
        """Width of the image at the focus."""
        focal = float(self.camera.focal_px[0, 0])
        return self.distance_m * self.camera.size_px[1] / focal


def place_moving_objects(area: StageArea, count: int, rng: Rng) -> list[PlacedObject]:
    """Place up to ``count`` moving objects; fewer if there is no room."""
    placed_objects: list[PlacedObject] = []
    for number in range(count):
        for attempt in range(14):
            child = rng.child("mover", number, attempt)
            placed = _try_mover(area, count, number, child)
            if placed is not None:
                area.plan.watch(placed.parts, placed.shape.height)
                placed_objects.append(placed)
                break
    return placed_objects


def _try_mover(area: StageArea, count: int, number: int, rng: Rng) -> PlacedObject | None:
    name, family = area.sampler.sample_moving_object(rng, is_lead=number == 0)
    motion = MOTIONS[name]
    size = area.radius_m * rng.uniform(0.5, 0.95) * (1.0, 0.8, 0.68)[min(count, 3) - 1]
    shape = shape_of_size(family, size, rng, motion.heights_m)
    if shape is None:
        return None
    heading = rng.weighted_choice(list(HEADINGS), (3.0, 3.0, 1.0, 1.0))
    travel = _travel(area, heading, motion, rng)
    context = MotionContext(
        shape=shape, times_s=area.times_s, travel_m=travel, rng=rng.child("act")
    )
    result = motion.perform(context)
    yaw = _yaw(area, heading, rng) if motion.travels else rng.uniform(0.0, 2 * np.pi)
    if name in ("swings", "bends", "flutters"):
        yaw = rng.uniform(-0.6, 0.6)
    x, z = _position(area, count, number, rng)
    at = np.array([x, 0.0, z])
    parts = tuple(part @ about_y(yaw).T + at for part in result.parts)
    placed = PlacedObject(
        family=family, shape=result.shape, parts=parts, motion=name, size_m=shape.height
    )
    if not _is_acceptable(area, placed, motion, heading):
        return None
    return _maybe_reversed(area, placed, heading, rng.child("against"))


def _maybe_reversed(area: StageArea, placed: PlacedObject, heading: str, rng: Rng) -> PlacedObject:
    """Randomly reverse the displacement, as far as the object stays in view.

    Objects start on one side and face their direction of motion, so the first image alone reveals
    the motion. A reversed object has the same first image; only the caption states its direction.
    """
    motion = MOTIONS[placed.motion]
    if not motion.travels or not rng.bernoulli(area.against_share):
        return placed
    for share in REVERSED_SHARES:
        other = replace(placed, parts=reversed_motion(placed.parts, share))
        if _is_acceptable(area, other, motion, OPPOSITE[heading]):
            return other
    return placed


def reversed_motion(parts: PartPositions, share: float) -> PartPositions:
    """The same first frame and rotation, with ``share`` of the displacement reversed."""
    total = sum(part.shape[1] for part in parts)
    way = sum((part - part[:1]).sum(1) for part in parts) / total
    back = (1 + share) * way * np.array([1.0, 0.0, 1.0])
    return tuple(part - back[:, None] for part in parts)


def freeze(placed: PlacedObject) -> PlacedObject:
    """The object, static at its first frame."""
    return replace(placed, parts=tuple(part[:1] for part in placed.parts), motion="")


def _travel(area: StageArea, heading: str, motion: Motion, rng: Rng) -> float:
    if heading in ("left", "right") or not motion.travels:
        return area.width_m * rng.uniform(0.16, 0.32)
    return area.distance_m * rng.uniform(0.22, 0.36)


def _axes(camera: Camera) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Unit vectors right and away on the ground, at the first frame."""
    rotation = camera.world_from_camera[0, :3, :3].numpy()
    right = rotation[:, 0] * np.array([1.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return right, np.array([-right[2], 0.0, right[0]])


def _yaw(area: StageArea, heading: str, rng: Rng) -> float:
    right, away = _axes(area.camera)
    across, ahead = HEADINGS[heading]
    way = across * right + ahead * away
    return float(np.arctan2(-way[2], way[0])) + rng.uniform(-0.32, 0.32)


def _position(area: StageArea, count: int, number: int, rng: Rng) -> tuple[float, float]:
    spread = 0.22 if count == 1 else 0.62
    angle = rng.uniform(0.0, 2 * np.pi) + number * 2 * np.pi / count
    out = area.radius_m * spread * rng.uniform(0.5, 1.0)
    return float(out * np.cos(angle)), float(0.8 * out * np.sin(angle))


def displacement(parts: PartPositions) -> Float64[np.ndarray, "3"]:
    """Displacement of the centre from the first to the last frame, in metres."""
    total = sum(part.shape[1] for part in parts)
    way = sum((part[-1] - part[0]).sum(0) for part in parts)
    return np.asarray(way / total)


def camera_direction(parts: PartPositions, camera: Camera) -> Direction:
    """The measured heading of a displacement; empty if no heading dominates."""
    right, away = _axes(camera)
    way = displacement(parts)
    across, ahead = float(way @ right), float(way @ away)
    size = np.hypot(across, ahead)
    if size < 1e-6 or max(abs(across), abs(ahead)) < 0.8 * size:
        return ""
    if abs(across) > abs(ahead):
        return "right" if across > 0 else "left"
    return "away" if ahead > 0 else "toward"


def _is_acceptable(area: StageArea, placed: PlacedObject, motion: Motion, heading: str) -> bool:
    if motion.travels and camera_direction(placed.parts, area.camera) != heading:
        return False
    return _is_in_view(area, placed) and _has_room(area, placed)


def _is_in_view(area: StageArea, placed: PlacedObject) -> bool:
    """Whether the object is inside the first image, mostly in the others, and of a good size."""
    points = torch.from_numpy(np.concatenate([part[:, ::7] for part in placed.parts], 1))
    pixels, z = project(area.camera, points)
    height, width = area.camera.size_px
    limit = torch.tensor([width, height], dtype=torch.float64)
    inside = ((pixels > 0) & (pixels < limit)).all(-1) & (z > 0.1 * area.distance_m)
    share = inside.double().mean(1)
    extent = (pixels[0].amax(0) - pixels[0].amin(0)) / limit
    size = float(extent.max())
    return float(share[0]) > 0.92 and float(share.mean()) > 0.75 and 0.1 < size < 0.85


def _has_room(area: StageArea, placed: PlacedObject) -> bool:
    low = np.min([part.min(1) for part in placed.parts], axis=0)
    high = np.max([part.max(1) for part in placed.parts], axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if float(high[:, 1].max()) > 1e-6:
        return False
    for k in range(0, len(low), 2):
        radius = float(np.hypot(half[k, 0], half[k, 2]))
        x, z = float(middle[k, 0]), float(middle[k, 2])
        away = np.hypot(area.plan.eyes[:, 0] - x, area.plan.eyes[:, 2] - z)
        if not area.plan.is_free(x, z, radius) or float(away.min()) < radius + area.plan.margin_m:
            return False
    return True
