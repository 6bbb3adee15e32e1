"""One picture by rays: as many pixels at a time as memory holds, in the order of reading.

Axes: ``p`` pixels, ``s`` samples, ``r`` = p · s rays.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.effects import Effects
from diff4splat.render.physical.exposing import Subject, geometry, middle_s
from diff4splat.render.physical.intervals import Intervals, choose_intervals
from diff4splat.render.physical.lines import line_of
from diff4splat.render.physical.sampling import draw
from diff4splat.render.physical.sensor import Draws, SensorRays, sensor_rays
from diff4splat.render.physical.settings import GEOMETRY, Photograph, PhotoSettings
from diff4splat.render.physical.viewer import viewer_of
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

BYTES_PER_RAY = 512
"""What a ray in flight takes, with room to spare."""
_OF_DISTANCE = {"distance": "distance", "depth": "distance", "median_depth": "median_distance"}
Pictures = dict[str, Float[Tensor, "p ..."] | Bool[Tensor, " p"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposure:
    """A picture that is about to be taken."""

    subject: Scene | Gaussians
    camera: PhysicalCamera
    time_s: float
    settings: PhotoSettings
    effects: Effects

    def take(self, outputs: frozenset[str]) -> Photograph:
        """The pictures named in ``outputs``."""
        subject = self._subject()
        pixels = self._in_reading_order()
        parts = []
        for own in pixels.split(self._pixels_at_once()):
            parts.append(self._part(subject, own, outputs))
            if len(own) < len(pixels):
                self._require_room(parts[-1], len(pixels))
        order = pixels.argsort()
        size_px = self.camera.camera.size_px
        pictures = {
            name: torch.cat([part[name] for part in parts])[order].unflatten(0, size_px)
            for name in parts[0]
        }
        return Photograph(
            **pictures,
            samples=self.effects.samples,
            intervals=len(subject.intervals),
            interval_error_px=subject.intervals.error_px,
            left_out=self.effects.left_out,
            dropped_nonfinite=subject.dropped,
        )

    def _subject(self) -> Subject:
        middle = middle_s(self.camera.optics, self.time_s)
        viewer = viewer_of(self.camera, middle)
        first, last = (edge - self.time_s for edge in self.camera.optics.window_s(self.time_s))
        intervals = Intervals((first, last), 0.0)
        if self.effects.scene_moves and isinstance(self.subject, Scene):
            intervals = choose_intervals(
                self.subject, self.camera, self.time_s, viewer, self.settings
            )
        return Subject(
            scene=self.subject,
            time_s=self.time_s,
            intervals=intervals,
            viewer=viewer,
            settings=self.settings,
            moves=self.effects.scene_moves,
        )

    def _in_reading_order(self) -> Int[Tensor, " p"]:
        """All pixels, line by line: neighbours are seen at about the same time."""
        camera, shutter = self.camera.camera, self.camera.optics.shutter
        pixels = torch.arange(camera.size_px[0] * camera.size_px[1], device=camera.focal_px.device)
        if shutter is None:
            return pixels
        return pixels[line_of(pixels, camera.size_px, shutter.direction).argsort(stable=True)]

    def _pixels_at_once(self) -> int:
        return max(self.settings.memory_bytes // (BYTES_PER_RAY * self.effects.samples), 1)

    def _require_room(self, part: Pictures, pixels: int) -> None:
        """Rays with gradients are all in flight until the way back.

        Raises:
            InputError: they are more than memory holds.
        """
        if not any(value.requires_grad for value in part.values()):
            return
        samples, memory = self.effects.samples, self.settings.memory_bytes
        raise InputError(
            f"photograph: expected at most {memory // BYTES_PER_RAY:,} rays with gradients in "
            f"{memory >> 20} MiB, got {pixels:,} pixels of {samples} samples; take fewer samples "
            "or raise memory_bytes"
        )

    def _part(
        self, subject: Subject, pixels: Int[Tensor, " p"], outputs: frozenset[str]
    ) -> Pictures:
        """The pictures of some pixels."""
        middle, blended = self._rays(pixels, Draws()), outputs - GEOMETRY
        valid, told = middle.exists[:, 0], outputs
        own: Pictures = {}
        if self.effects.scatters:
            own, covered = self._blended(subject, pixels, blended)
            valid, told = valid & covered, outputs & GEOMETRY
        asked = _traced(told)
        seen = subject.look(middle, asked) if asked else {}
        own |= {name: seen[name] for name in blended & asked} | geometry(seen, middle, told)
        return {name: _masked(value, valid) for name, value in own.items()} | {"valid": valid}

    def _blended(
        self, subject: Subject, pixels: Int[Tensor, " p"], outputs: frozenset[str]
    ) -> tuple[Pictures, Bool[Tensor, " p"]]:
        """Means over the samples that exist, and where there are any."""
        rays = self._rays(pixels, draw(self.effects, pixels, self.settings.seed))
        count = rays.exists.sum(1)
        if not outputs:
            return {}, count > 0
        seen = subject.look(rays, outputs)
        totals = {k: value.unflatten(0, rays.exists.shape).sum(1) for k, value in seen.items()}
        seen_by = count.clamp_min(1).to(rays.origins)
        means = {k: v / seen_by.view(-1, *(1,) * (v.ndim - 1)) for k, v in totals.items()}
        return means, count > 0

    def _rays(self, pixels: Int[Tensor, " p"], draws: Draws) -> SensorRays:
        return sensor_rays(self.camera, pixels, draws, self.time_s, self.effects.rolls)


def _traced(outputs: frozenset[str]) -> frozenset[str]:
    """What the tracer is asked for."""
    return frozenset(_OF_DISTANCE.get(name, name) for name in outputs if name != "time_s")


def _masked(values: Float[Tensor, "p ..."], valid: Bool[Tensor, " p"]) -> Float[Tensor, "p ..."]:
    """0 where a pixel sees nothing."""
    return torch.where(valid.view(-1, *(1,) * (values.ndim - 1)), values, 0.0)
