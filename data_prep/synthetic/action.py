"""Who moves, how, and where: movers are placed so that the input view sees them well.

A heading is meant as the input camera sees it at the first frame: right is its x axis on the
ground, away its viewing direction. What is meant is checked against the numbers before anything is
built around it.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float64

from diff4splat.captions.vocabulary import OPPOSITE
from diff4splat.data_prep.synthetic.cast import Cast
from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.plan import Placed, Plan
from diff4splat.data_prep.synthetic.layout.props import natural_shape
from diff4splat.data_prep.synthetic.motions.act import Act, Posed
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS, Motion
from diff4splat.data_prep.synthetic.shapes.surface import about_y
from diff4splat.geometry.camera import Camera, project

Direction = str
HEADINGS: dict[Direction, tuple[float, float]] = {
    "left": (-1.0, 0.0),
    "right": (1.0, 0.0),
    "toward": (0.0, -1.0),
    "away": (0.0, 1.0),
}
"""(right, away) as the input camera sees it."""
TURNED_SHARES = (1.0, 0.7, 0.5)
"""Of the way, tried in this order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """What movers need to know about the world they are put into."""

    radius_m: float
    times_s: Float64[np.ndarray, " t"]
    camera: Camera
    """The input view."""
    distance_m: float
    plan: Plan
    cast: Cast
    against_share: float = 0.0
    """Share of travelling movers that go the other way than their place and facing suggest."""

    @property
    def width_m(self) -> float:
        """Of the picture at the focus."""
        focal = float(self.camera.focal_px[0, 0])
        return self.distance_m * self.camera.size_px[1] / focal


def movers(stage: Stage, count: int, draws: Draws) -> list[Placed]:
    """Up to ``count`` things that move; fewer where there is no room."""
    found: list[Placed] = []
    for number in range(count):
        for attempt in range(14):
            mine = draws.child("mover", number, attempt)
            placed = _try_mover(stage, count, number, mine)
            if placed is not None:
                stage.plan.watch(placed.parts, placed.shape.height)
                found.append(placed)
                break
    return found


def _try_mover(stage: Stage, count: int, number: int, draws: Draws) -> Placed | None:
    name, family = stage.cast.mover(draws, is_lead=number == 0)
    motion = MOTIONS[name]
    size = stage.radius_m * draws.between(0.5, 0.95) * (1.0, 0.8, 0.68)[min(count, 3) - 1]
    shape = natural_shape(family, size, draws, motion.heights_m)
    if shape is None:
        return None
    heading = draws.weighted(list(HEADINGS), (3.0, 3.0, 1.0, 1.0))
    travel = _travel(stage, heading, motion, draws)
    act = Act(shape=shape, times_s=stage.times_s, travel_m=travel, draws=draws.child("act"))
    performed = motion.perform(act)
    yaw = _yaw(stage, heading, draws) if motion.travels else draws.between(0.0, 2 * np.pi)
    if name in ("swings", "bends", "flutters"):
        yaw = draws.between(-0.6, 0.6)
    x, z = _place(stage, count, number, draws)
    at = np.array([x, 0.0, z])
    parts = tuple(part @ about_y(yaw).T + at for part in performed.parts)
    placed = Placed(
        family=family, shape=performed.shape, parts=parts, motion=name, size_m=shape.height
    )
    if not _is_good(stage, placed, motion, heading):
        return None
    return _turned(stage, placed, heading, draws.child("against"))


def _turned(stage: Stage, placed: Placed, heading: str, draws: Draws) -> Placed:
    """Perhaps the same thing going the other way, as far as it stays in view.

    Things begin on one side, face where they go and go to the other side: a first picture that
    tells all that needs no caption. After this the first picture is the same and the way is not.
    """
    motion = MOTIONS[placed.motion]
    if not motion.travels or not draws.chance(stage.against_share):
        return placed
    for share in TURNED_SHARES:
        other = replace(placed, parts=turned_back(placed.parts, share))
        if _is_good(stage, other, motion, OPPOSITE[heading]):
            return other
    return placed


def turned_back(parts: Posed, share: float) -> Posed:
    """The same first frame and turning, but ``share`` of the way in the other direction."""
    total = sum(part.shape[1] for part in parts)
    way = sum((part - part[:1]).sum(1) for part in parts) / total
    back = (1 + share) * way * np.array([1.0, 0.0, 1.0])
    return tuple(part - back[:, None] for part in parts)


def frozen(placed: Placed) -> Placed:
    """The thing as the first frame shows it, standing."""
    return replace(placed, parts=tuple(part[:1] for part in placed.parts), motion="")


def _travel(stage: Stage, heading: str, motion: Motion, draws: Draws) -> float:
    if heading in ("left", "right") or not motion.travels:
        return stage.width_m * draws.between(0.16, 0.32)
    return stage.distance_m * draws.between(0.22, 0.36)


def _axes(camera: Camera) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Right and away on the ground, unit length, at the first frame."""
    rotation = camera.world_from_camera[0, :3, :3].numpy()
    right = rotation[:, 0] * np.array([1.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    return right, np.array([-right[2], 0.0, right[0]])


def _yaw(stage: Stage, heading: str, draws: Draws) -> float:
    right, away = _axes(stage.camera)
    across, ahead = HEADINGS[heading]
    way = across * right + ahead * away
    return float(np.arctan2(-way[2], way[0])) + draws.between(-0.32, 0.32)


def _place(stage: Stage, count: int, number: int, draws: Draws) -> tuple[float, float]:
    spread = 0.22 if count == 1 else 0.62
    angle = draws.between(0.0, 2 * np.pi) + number * 2 * np.pi / count
    out = stage.radius_m * spread * draws.between(0.5, 1.0)
    return float(out * np.cos(angle)), float(0.8 * out * np.sin(angle))


def displacement(parts: Posed) -> Float64[np.ndarray, "3"]:
    """How far the middle of a thing has come from the first frame to the last; metres."""
    total = sum(part.shape[1] for part in parts)
    way = sum((part[-1] - part[0]).sum(0) for part in parts)
    return np.asarray(way / total)


def direction_seen(parts: Posed, camera: Camera) -> Direction:
    """Which heading a displacement is, measured; empty when it is none of them clearly."""
    right, away = _axes(camera)
    way = displacement(parts)
    across, ahead = float(way @ right), float(way @ away)
    size = np.hypot(across, ahead)
    if size < 1e-6 or max(abs(across), abs(ahead)) < 0.8 * size:
        return ""
    if abs(across) > abs(ahead):
        return "right" if across > 0 else "left"
    return "away" if ahead > 0 else "toward"


def _is_good(stage: Stage, placed: Placed, motion: Motion, heading: str) -> bool:
    if motion.travels and direction_seen(placed.parts, stage.camera) != heading:
        return False
    return _is_in_view(stage, placed) and _has_room(stage, placed)


def _is_in_view(stage: Stage, placed: Placed) -> bool:
    """Nearly all of it is in the first picture, most of it on average, at a good size."""
    points = torch.from_numpy(np.concatenate([part[:, ::7] for part in placed.parts], 1))
    pixels, z = project(stage.camera, points)
    height, width = stage.camera.size_px
    limit = torch.tensor([width, height], dtype=torch.float64)
    inside = ((pixels > 0) & (pixels < limit)).all(-1) & (z > 0.1 * stage.distance_m)
    share = inside.double().mean(1)
    extent = (pixels[0].amax(0) - pixels[0].amin(0)) / limit
    size = float(extent.max())
    return float(share[0]) > 0.92 and float(share.mean()) > 0.75 and 0.1 < size < 0.85


def _has_room(stage: Stage, placed: Placed) -> bool:
    low = np.min([part.min(1) for part in placed.parts], axis=0)
    high = np.max([part.max(1) for part in placed.parts], axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    if float(high[:, 1].max()) > 1e-6:
        return False
    for k in range(0, len(low), 2):
        radius = float(np.hypot(half[k, 0], half[k, 2]))
        x, z = float(middle[k, 0]), float(middle[k, 2])
        away = np.hypot(stage.plan.eyes[:, 0] - x, stage.plan.eyes[:, 2] - z)
        if not stage.plan.is_free(x, z, radius) or float(away.min()) < radius + stage.plan.margin_m:
            return False
    return True
