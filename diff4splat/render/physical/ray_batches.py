"""Batches of sensor rays, traced through a scene that may move during the exposure.

Axes: ``p`` pixels, ``s`` samples, ``r`` rays.
"""

from collections import OrderedDict
from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.optics import Optics
from diff4splat.render.physical.intervals import Intervals
from diff4splat.render.physical.linear_motion import (
    LinearSegment,
    linear_segment,
    native_segment,
    smoothed_segment,
    static_segment,
)
from diff4splat.render.physical.sensor import SensorRays
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.physical.view_cone import ViewCone
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.bvh.bvh import Bvh, TimedGaussians
from diff4splat.render.trace.bvh.bvh_build import build_bvh
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene

_STATES = 8
"""Segments cached for the next rays."""


@dataclass(slots=True, kw_only=True)
class MovingScene:
    """A scene around the time of one frame, in linear segments of time."""

    scene: Scene | Gaussians
    time_s: float
    intervals: Intervals
    cone: ViewCone
    settings: PhotoSettings
    moves: bool
    dropped: int = 0
    """Largest number of invalid Gaussians in a segment."""
    _bvh: Bvh | None = None
    _cached: "OrderedDict[int, LinearSegment]" = field(default_factory=OrderedDict)
    _ends: dict[float, Gaussians] = field(default_factory=dict)

    def trace(self, rays: SensorRays, outputs: frozenset[str]) -> dict[str, Float[Tensor, "r ..."]]:
        """Outputs along the rays, flat; 0 where a ray does not exist."""
        exists, offset_s = rays.exists.flatten(), rays.offset_s.flatten()
        origins, directions = rays.origins.flatten(0, 1), rays.directions.flatten(0, 1)
        if len(self.intervals) == 1:
            return self._trace(0, origins, directions, exists, offset_s, outputs)
        segment = self.intervals.of(offset_s)
        parts, rows = [], []
        for index in segment.unique().tolist():
            own = (segment == index).nonzero().squeeze(1)
            rows.append(own)
            parts.append(
                self._trace(
                    index, origins[own], directions[own], exists[own], offset_s[own], outputs
                )
            )
        order = torch.cat(rows).argsort()
        return {name: torch.cat([part[name] for part in parts])[order] for name in parts[0]}

    def _trace(
        self,
        index: int,
        origins: Float[Tensor, "r 3"],
        directions: Float[Tensor, "r 3"],
        exists: Bool[Tensor, " r"],
        offset_s: Float[Tensor, " r"],
        outputs: frozenset[str],
    ) -> dict[str, Float[Tensor, "r ..."]]:
        segment = self._segment(index)
        rays = Rays(
            origins=origins,
            directions=directions,
            valid=None if bool(exists.all()) else exists,
            time_s=self._clamped(offset_s) if segment.moving is not None else None,
        )
        if self._bvh is None:
            self._bvh = self._build_bvh(segment)
        traced = trace(
            segment.gaussians,
            rays,
            outputs=outputs,
            settings=self.settings.trace,
            moving=segment.moving,
            bvh=self._bvh,
        )
        self.dropped = max(self.dropped, traced.dropped_nonfinite)
        return {name: getattr(traced, name) for name in outputs}

    def _build_bvh(self, segment: LinearSegment) -> Bvh:
        """The hierarchy of the first segment; neighbours hardly change within one image."""
        state = TimedGaussians(
            gaussians=segment.gaussians,
            moving=segment.moving,
            earliest_s=segment.earliest_s,
            latest_s=segment.latest_s,
        )
        return build_bvh([state], self.settings.trace)

    def _clamped(self, offset_s: Float[Tensor, " r"]) -> Float[Tensor, " r"]:
        """Times within those of the motion, which is constant before and after.

        Only native 4D Gaussians need this; the ends of other segments are states of the motion.
        """
        assert isinstance(self.scene, Scene)
        if not isinstance(self.scene.motion, SpacetimeMotion):
            return offset_s
        start, stop = self.scene.motion.time_range_s
        return offset_s.clamp(start - self.time_s, stop - self.time_s)

    def _segment(self, index: int) -> LinearSegment:
        if index in self._cached:
            self._cached.move_to_end(index)
            return self._cached[index]
        new = self._make(*self.intervals.spans()[index])
        self._cached[index] = new
        if len(self._cached) > _STATES and not new.gaussians.means.requires_grad:
            self._cached.popitem(last=False)
        return new

    def _make(self, earliest_s: float, latest_s: float) -> LinearSegment:
        scene, base_s = self.scene, self.time_s
        if isinstance(scene, Gaussians):
            new = static_segment(scene, earliest_s, latest_s)
        elif not self.moves:
            # Motion that is not visible: the image is of the middle.
            middle_s = base_s + 0.5 * (earliest_s + latest_s)
            new = static_segment(scene.state_at(middle_s), earliest_s, latest_s)
        elif isinstance(scene.motion, SpacetimeMotion):
            new = native_segment(scene, earliest_s, latest_s, base_s)
        else:
            states = (self._end(scene, at) for at in (earliest_s, latest_s))
            new = linear_segment(*states, earliest_s, latest_s)
        return self._smoothed(new)

    def _end(self, scene: Scene, at_s: float) -> Gaussians:
        """The state at an end of a segment, which it shares with its neighbour."""
        if at_s not in self._ends:
            last = list(self._ends.items())[-1:]
            self._ends = dict([*last, (at_s, scene.state_at(self.time_s + at_s))])
        return self._ends[at_s]

    def _smoothed(self, segment: LinearSegment) -> LinearSegment:
        variance = self.settings.smoothing_px2 / self.cone.pixels_per_radian**2
        return smoothed_segment(segment, self.cone.position, variance)


def geometry(
    traced: dict[str, Float[Tensor, "r ..."]], rays: SensorRays, outputs: frozenset[str]
) -> dict[str, Float[Tensor, " r"]]:
    """Depths and times from distances; the depth of what is behind the camera is 0."""
    along = rays.along.flatten().clamp_min(0.0)
    outputs_by_name = {"time_s": rays.offset_s.flatten()}
    if "distance" in traced:
        outputs_by_name |= {"distance": traced["distance"], "depth": traced["distance"] * along}
    if "median_distance" in traced:
        outputs_by_name["median_depth"] = traced["median_distance"] * along
    return {name: value for name, value in outputs_by_name.items() if name in outputs}


def middle_s(optics: Optics, time_s: float) -> float:
    """The middle of the exposure and read-out of a frame at ``time_s``."""
    first, last = optics.window_s(time_s)
    return 0.5 * (first + last)
