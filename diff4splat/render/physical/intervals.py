"""Into which intervals the time of an image is split, so that Gaussians may go straight in each.

An interval is halved until, for everything the camera sees, places in it are as near to the
straight line, and shapes, opacities and colours as near to those halfway, as the tolerance asks
for. Times at which a motion has a kink are ends of intervals from the start. A change of
brightness counts as many pixels as an edge one pixel wide must move to make it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.geometry import quaternion
from diff4splat.geometry.optics import Shutter, as_float
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.linear_motion import is_linear, midpoint
from diff4splat.render.physical.sensor_rows import line_count, line_shares
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.physical.view_cone import ViewCone
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene

_PROBES = (0.3, 0.6)
"""Near the largest error of a bow, ½, and of an S, 0.21, which has none in its middle."""
_KEPT = 4
"""States at ends of intervals that are kept for their neighbours."""


@dataclass(frozen=True, slots=True)
class Intervals:
    """Neighbouring intervals of time, relative to the frame's."""

    edges_s: tuple[float, ...]
    error_px: float
    """Left over, as far as it was looked at."""

    def __len__(self) -> int:
        return max(len(self.edges_s) - 1, 1)

    def spans(self) -> list[tuple[float, float]]:
        """Earliest and latest of each."""
        if len(self.edges_s) == 1:
            return [(self.edges_s[0], self.edges_s[0])]
        return list(pairwise(self.edges_s))

    def of(self, times_s: Float[Tensor, " r"]) -> Tensor:
        """The interval of each time; times outside belong to the nearest one."""
        inner = times_s.new_tensor(self.edges_s[1:-1])
        return torch.bucketize(times_s.detach(), inner, right=True)


@torch.no_grad()
def choose_intervals(
    scene: Scene, camera: PhysicalCamera, time_s: float, cone: ViewCone, settings: PhotoSettings
) -> Intervals:
    """Intervals for one image of a scene that moves meanwhile."""
    window = camera.optics.window_s(time_s)
    first, last = (edge - time_s for edge in window)
    if is_linear(scene):
        return Intervals((first, last), 0.0)
    moving = _only_moving(scene)
    shutter = camera.optics.shutter
    rolls = shutter is not None and as_float(shutter.readout_s) > 0
    if rolls and settings.rows_per_chunk is not None:
        edges = _chunk_edges(camera, shutter, settings.rows_per_chunk, first)
        return Intervals(edges, _largest(moving, edges, time_s, cone))
    kinks = [kink - time_s for kink in _kinks_s(scene.motion)]
    edges = [first, *(kink for kink in kinks if first < kink < last), last]
    return _halved(moving, edges, time_s, cone, settings)


def _only_moving(scene: Scene) -> Scene:
    moves = torch.zeros(len(scene.gaussians), dtype=torch.bool, device=scene.gaussians.means.device)
    moves[scene.motion.moving_index] = True
    own = scene.select(moves)
    if isinstance(own.motion, SpacetimeMotion):
        # Pulses are exact at any length; what is left are colours.
        always = torch.full_like(own.motion.time_deviations_s, torch.inf)
        own = replace(own, motion=replace(own.motion, time_deviations_s=always))
    return own


def _kinks_s(motion: Motion) -> Sequence[float]:
    """Times at which a motion turns sharply."""
    if isinstance(motion, KeyframeMotion):
        return motion.key_times_s.tolist()
    if isinstance(motion, HexPlaneMotion):
        return list(motion.planes.node_times_s)
    return []


def _chunk_edges(
    camera: PhysicalCamera, shutter: Shutter, rows: int, first: float
) -> tuple[float, ...]:
    """Halfway between the last line of a chunk and the first of the next, in order of reading."""
    optics = camera.optics
    shares = line_shares(line_count(camera.camera.size_px, shutter.direction), "top-to-bottom")
    ends = [float(shares[k - 1 : k + 1].mean()) for k in range(rows, len(shares), rows)]
    first_line = first + 0.5 * as_float(optics.exposure_s)
    inner = (first_line + share * as_float(shutter.readout_s) for share in ends)
    return first, *inner, first + optics.duration_s


def _halved(
    scene: Scene, edges: list[float], time_s: float, cone: ViewCone, settings: PhotoSettings
) -> Intervals:
    """Halve the interval with the largest error until all are within the tolerance."""
    measure = _Measure(scene, time_s, cone)
    errors = {span: measure.error_px(*span) for span in pairwise(edges)}
    while len(errors) < settings.most_intervals:
        worst = max(errors, key=lambda span: errors[span])
        if errors[worst] <= settings.tolerance_px:
            break
        del errors[worst]
        middle = 0.5 * (worst[0] + worst[1])
        for span in ((worst[0], middle), (middle, worst[1])):
            errors[span] = measure.error_px(*span)
    ends = sorted({edge for span in errors for edge in span})
    return Intervals(tuple(ends), max(errors.values()))


def _largest(scene: Scene, edges: Sequence[float], time_s: float, cone: ViewCone) -> float:
    measure = _Measure(scene, time_s, cone)
    return max(measure.error_px(*span) for span in pairwise(edges))


class _Measure:
    """Errors of intervals; keeps the last states, since neighbours share their ends."""

    def __init__(self, scene: Scene, time_s: float, cone: ViewCone) -> None:
        self._scene, self._time_s, self._cone = scene, time_s, cone
        self._ends: dict[float, Gaussians] = {}

    def error_px(self, earliest_s: float, latest_s: float) -> float:
        """Largest error of one interval at its ends and in between."""
        if earliest_s == latest_s:
            return 0.0
        early, late = self._end(earliest_s), self._end(latest_s)
        straight = Straight(early, late)
        largest = max(
            straight.error_px(early, 0.0, self._cone), straight.error_px(late, 1.0, self._cone)
        )
        for part in _PROBES:
            at_s = earliest_s + part * (latest_s - earliest_s)
            state = self._scene.state_at(self._time_s + at_s)
            largest = max(largest, straight.error_px(state, part, self._cone))
        return largest

    def _end(self, at_s: float) -> Gaussians:
        if at_s not in self._ends:
            if len(self._ends) >= _KEPT:
                del self._ends[next(iter(self._ends))]
            self._ends[at_s] = self._scene.state_at(self._time_s + at_s)
        return self._ends[at_s]


class Straight:
    """The linear approximation between two states, compared with the true states."""

    def __init__(self, early: Gaussians, late: Gaussians) -> None:
        self._early, self._late = early.means, late.means
        self._midpoint = midpoint(early, late)
        self._shape = _root(self._midpoint)

    def error_px(self, true: Gaussians, part: float, cone: ViewCone) -> float:
        """Largest visible error of position, shape and brightness in pixels; 0 if none is visible.

        ``true`` is the state at ``part`` of the interval.
        """
        approximate = self._midpoint
        visible = cone.contains(true) | cone.contains(approximate)
        if not bool(visible.any()):
            return 0.0
        place = (true.means - torch.lerp(self._early, self._late, part)).norm(dim=-1)
        shape = (_root(true) - self._shape).norm(dim=-1).amax(-1)
        return float(
            (cone.pixels(place + shape, true) + _brightness(true, approximate))[visible].max()
        )


def _brightness(true: Gaussians, approximate: Gaussians) -> Float[Tensor, " n"]:
    """How much opacity and colour are off; |Σ_k a_k Y_k| ≤ |a| √(K / 4π) for all K of a degree."""
    colors = (true.sh - approximate.sh).square().sum(1).amax(-1) * (
        true.sh.shape[1] / (4 * math.pi)
    )
    return (true.opacities - approximate.opacities).abs() + approximate.opacities * colors.sqrt()


def _root(gaussians: Gaussians) -> Float[Tensor, "n 3 3"]:
    """R S Rᵀ, the square root of the covariance: of a sphere it is the same however it turns."""
    turns = quaternion.to_matrix(gaussians.quats)
    return (turns * gaussians.scales[:, None]) @ turns.mT
