"""Rays in flight: what the sensor's rays see of a scene that may move meanwhile.

Axes: ``p`` pixels, ``s`` samples, ``r`` rays.
"""

from collections import OrderedDict
from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.optics import Optics
from diff4splat.render.physical.intervals import Intervals
from diff4splat.render.physical.sensor import SensorRays
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.physical.straight import (
    Stretch,
    between,
    exact_stretch,
    smoothed,
    still,
)
from diff4splat.render.physical.viewer import Viewer
from diff4splat.render.trace.api import trace
from diff4splat.render.trace.hierarchy import SearchTree, State, span
from diff4splat.render.trace.rays import Rays
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.spacetime import SpacetimeMotion
from diff4splat.scene.scene import Scene

_STATES = 8
"""Stretches kept for the next rays."""


@dataclass(slots=True, kw_only=True)
class Subject:
    """A scene around the time of one frame, stretch by stretch."""

    scene: Scene | Gaussians
    time_s: float
    intervals: Intervals
    viewer: Viewer
    settings: PhotoSettings
    moves: bool
    dropped: int = 0
    """Gaussians that no ray can see, at most at once."""
    _tree: SearchTree | None = None
    _kept: "OrderedDict[int, Stretch]" = field(default_factory=OrderedDict)
    _ends: dict[float, Gaussians] = field(default_factory=dict)

    def look(self, rays: SensorRays, outputs: frozenset[str]) -> dict[str, Float[Tensor, "r ..."]]:
        """What the rays see, flat; those that do not exist see 0."""
        exists, offset_s = rays.exists.flatten(), rays.offset_s.flatten()
        origins, directions = rays.origins.flatten(0, 1), rays.directions.flatten(0, 1)
        if len(self.intervals) == 1:
            return self._trace(0, origins, directions, exists, offset_s, outputs)
        found = self.intervals.of(offset_s)
        parts, places = [], []
        for index in found.unique().tolist():
            own = (found == index).nonzero().squeeze(1)
            places.append(own)
            parts.append(
                self._trace(
                    index, origins[own], directions[own], exists[own], offset_s[own], outputs
                )
            )
        order = torch.cat(places).argsort()
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
        stretch = self._stretch(index)
        rays = Rays(
            origins=origins,
            directions=directions,
            valid=None if bool(exists.all()) else exists,
            time_s=self._clamped(offset_s) if stretch.moving is not None else None,
        )
        if self._tree is None:
            self._tree = self._neighbours(stretch)
        seen = trace(
            stretch.gaussians,
            rays,
            outputs=outputs,
            settings=self.settings.trace,
            moving=stretch.moving,
            tree=self._tree,
        )
        self.dropped = max(self.dropped, seen.dropped_nonfinite)
        return {name: getattr(seen, name) for name in outputs}

    def _neighbours(self, stretch: Stretch) -> SearchTree:
        """Of the first stretch: they hardly change within one picture."""
        state = State(
            gaussians=stretch.gaussians,
            moving=stretch.moving,
            earliest_s=stretch.earliest_s,
            latest_s=stretch.latest_s,
        )
        return span([state], self.settings.trace)

    def _clamped(self, offset_s: Float[Tensor, " r"]) -> Float[Tensor, " r"]:
        """Before its first and after its last time a motion stands still.

        The ends of other stretches than those of native 4D Gaussians know that already.
        """
        assert isinstance(self.scene, Scene)
        if not isinstance(self.scene.motion, SpacetimeMotion):
            return offset_s
        start, stop = self.scene.motion.time_range_s
        return offset_s.clamp(start - self.time_s, stop - self.time_s)

    def _stretch(self, index: int) -> Stretch:
        if index in self._kept:
            self._kept.move_to_end(index)
            return self._kept[index]
        made = self._make(*self.intervals.spans()[index])
        self._kept[index] = made
        if len(self._kept) > _STATES and not made.gaussians.means.requires_grad:
            self._kept.popitem(last=False)
        return made

    def _make(self, earliest_s: float, latest_s: float) -> Stretch:
        scene, base_s = self.scene, self.time_s
        if isinstance(scene, Gaussians):
            made = still(scene, earliest_s, latest_s)
        elif not self.moves:
            # Where nothing of it shows, a picture is of its middle.
            middle_s = base_s + 0.5 * (earliest_s + latest_s)
            made = still(scene.state_at(middle_s), earliest_s, latest_s)
        elif isinstance(scene.motion, SpacetimeMotion):
            made = exact_stretch(scene, earliest_s, latest_s, base_s)
        else:
            states = (self._end(scene, at) for at in (earliest_s, latest_s))
            made = between(*states, earliest_s, latest_s)
        return self._widened(made)

    def _end(self, scene: Scene, at_s: float) -> Gaussians:
        """The state at an end of a stretch, which is also that of its neighbour."""
        if at_s not in self._ends:
            last = list(self._ends.items())[-1:]
            self._ends = dict([*last, (at_s, scene.state_at(self.time_s + at_s))])
        return self._ends[at_s]

    def _widened(self, stretch: Stretch) -> Stretch:
        variance = self.settings.smoothing_px2 / self.viewer.pixels_per_radian**2
        return smoothed(stretch, self.viewer.place, variance)


def geometry(
    seen: dict[str, Float[Tensor, "r ..."]], rays: SensorRays, outputs: frozenset[str]
) -> dict[str, Float[Tensor, " r"]]:
    """Depths and times from distances; z of what is not in front of the camera is 0."""
    along = rays.along.flatten().clamp_min(0.0)
    answers = {"time_s": rays.offset_s.flatten()}
    if "distance" in seen:
        answers |= {"distance": seen["distance"], "depth": seen["distance"] * along}
    if "median_distance" in seen:
        answers["median_depth"] = seen["median_distance"] * along
    return {name: value for name, value in answers.items() if name in outputs}


def middle_s(optics: Optics, time_s: float) -> float:
    """The middle of everything that a frame of ``time_s`` sees."""
    first, last = optics.window_s(time_s)
    return 0.5 * (first + last)
