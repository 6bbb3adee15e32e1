"""Motions of an object about itself, as the words of a prompt name them (ours, ADR 47).

Axes: ``m`` points. Points are in the object's own frame: x to the right, y up from its foot, z to
the camera, in units of its height. All start at rest. Growth, turns and rates are the means of
those that procedural worlds draw (``data_prep.synthetic.motions``), which no image shows. What goes
to and fro has half of the mean size: where it is in its period is unknown, too.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.paths.easing import ease

Points = Float[Tensor, "m 3"]
GROWTH = 0.375
"""Of the full size: what is missing of it at first, or at last."""
SQUASH, SQUASH_HZ = 0.12, 0.9
TURNS, TURN_GAIN = 0.625, 0.3
"""Of a spin over the clip; how much faster it gets, as a share."""
TWIST_RAD, TWIST_HZ = 0.475, 0.575
BEND_RAD, BEND_HZ = 0.325, 0.575
SWAY, SWAY_HZ = 0.0475, 0.6
WOBBLE, WOBBLE_HZ, WOBBLE_DECAY_HZ = 0.14, 1.7, 0.6
RADIUS = 0.5
"""Of what rolls."""
UPRIGHT = (0.0, 1.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """A time of the clip."""

    time_s: float
    """Since its first frame."""
    progress: float
    """0 at the first frame, 1 at the last."""
    highest_hz: float
    """What key times can follow."""
    travel: Float[Tensor, "3"]
    """Displacement of the object, in its own frame."""
    sense: float = 1.0
    """Of rotation about the vertical: 1 or -1, where no word says it."""

    def phase(self, rate_hz: float) -> float:
        """Of what repeats, in radians."""
        return 2 * math.pi * min(rate_hz, self.highest_hz) * self.time_s

    @property
    def eased(self) -> float:
        """Progress that starts and ends slowly."""
        return float(ease(torch.tensor([self.progress], dtype=torch.float64), "smooth"))


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalMotion:
    """Where the points of an object are, before its displacement."""

    positions: Callable[[Points, Moment], Points]
    growth: Callable[[Moment], float] = lambda moment: 1.0
    """Size of the object over that of before."""
    shows_back: bool = False
    """Whether the side that the image hides comes to the front."""


def _size(moment: Moment, *, grows: bool) -> float:
    missing = GROWTH * ((1 - moment.eased) if grows else moment.eased)
    return (1 - missing) / (1 - GROWTH) if grows else 1 - missing


def _grown(moment: Moment) -> float:
    return _size(moment, grows=True)


def _shrunk(moment: Moment) -> float:
    return _size(moment, grows=False)


def _squashed(points: Points, moment: Moment) -> Points:
    """Flat and wide, then high and thin, of one volume."""
    upright = 1 + SQUASH * math.sin(moment.phase(SQUASH_HZ))
    return points * points.new_tensor([upright**-0.5, upright, upright**-0.5])


def _spun(points: Points, moment: Moment) -> Points:
    u = moment.progress
    turns = TURNS * (u + TURN_GAIN * u * u) / (1 + TURN_GAIN)
    return _rotated(points, UPRIGHT, points.new_tensor(2 * math.pi * turns * moment.sense))


def _twisted(points: Points, moment: Moment) -> Points:
    """The top turns against the foot, to and fro."""
    angle = TWIST_RAD * math.sin(moment.phase(TWIST_HZ)) * moment.sense
    return _rotated(points, UPRIGHT, angle * _share(points))


def _bent(points: Points, moment: Moment) -> Points:
    """The upright axis is a circular arc to one side, then to the other."""
    curve, share = BEND_RAD * math.sin(moment.phase(BEND_HZ)), _share(points)
    x, y, z = points.unbind(-1)
    angle = curve * share
    across = 0.5 * curve * share**2 * torch.sinc(angle / (2 * math.pi)) ** 2
    above = y - share
    up = share * torch.sinc(angle / math.pi) - x * angle.sin() + above * angle.cos()
    return torch.stack([across + x * angle.cos() + above * angle.sin(), up, z], -1)


def _swayed(points: Points, moment: Moment) -> Points:
    lean = SWAY * math.sin(moment.phase(SWAY_HZ))
    return _leaning(points, lean * _share(points) ** 1.5, 0.3)


def _wobbled(points: Points, moment: Moment) -> Points:
    """Shakes less and less."""
    strength = WOBBLE * math.exp(-WOBBLE_DECAY_HZ * moment.time_s)
    lean = strength * math.sin(moment.phase(WOBBLE_HZ))
    return _leaning(points, lean * _share(points) ** 1.4, 0.25)


def _leaning(points: Points, across: Float[Tensor, " m"], drop: float) -> Points:
    """Shifted to the side, and lower by a share of that."""
    down = drop * across.abs() * _share(points)
    return points + torch.stack([across, -down, torch.zeros_like(across)], -1)


def _rolled(points: Points, moment: Moment) -> Points:
    """Turns about its centre, without slip."""
    right, toward = float(moment.travel[0]), float(moment.travel[2])
    distance = math.hypot(right, toward)
    if distance == 0:
        return points
    centre, angle = points.new_tensor([0.0, RADIUS, 0.0]), points.new_tensor(distance / RADIUS)
    return _rotated(points - centre, (toward, 0.0, -right), angle) + centre


def _tumbled(points: Points, moment: Moment) -> Points:
    """The same over its edges: the lowest one of a box stays on the ground."""
    angle = math.hypot(float(moment.travel[0]), float(moment.travel[2])) / RADIUS
    lift = RADIUS * (abs(math.cos(angle)) + abs(math.sin(angle)) - 1)
    return _rolled(points, moment) + points.new_tensor([0.0, lift, 0.0])


def _rotated(
    points: Points, axis: tuple[float, float, float], angle_rad: Float[Tensor, "*m"]
) -> Points:
    """About an axis through the origin, by one angle or by one for each point."""
    axes, angles = points.new_tensor(axis).expand_as(points), angle_rad.expand(len(points))
    return quaternion.rotate(quaternion.from_axis_angle(axes, angles), points)


def _share(points: Points) -> Float[Tensor, " m"]:
    """Height above the foot, of the object's."""
    return points[:, 1].clamp(0, 1)


LOCAL_MOTIONS: dict[str, LocalMotion] = {
    "rolls": LocalMotion(positions=_rolled, shows_back=True),
    "tumbles": LocalMotion(positions=_tumbled, shows_back=True),
    "spins": LocalMotion(positions=_spun, shows_back=True),
    "twists": LocalMotion(positions=_twisted, shows_back=True),
    "squashes": LocalMotion(positions=_squashed),
    "grows": LocalMotion(positions=lambda points, at: points * _grown(at), growth=_grown),
    "shrinks": LocalMotion(positions=lambda points, at: points * _shrunk(at), growth=_shrunk),
    "bends": LocalMotion(positions=_bent),
    "wobbles": LocalMotion(positions=_wobbled),
    "sways": LocalMotion(positions=_swayed),
}
"""By the keys of ``captions.vocabulary.VERBS``."""
