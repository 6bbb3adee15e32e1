"""One image by ray tracing: as many pixels at a time as fit in memory, in read-out order.

Axes: ``p`` pixels, ``s`` samples, ``r`` = p · s rays.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from diff4splat.errors import InputError
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.effects import Effects
from diff4splat.render.physical.intervals import Intervals, choose_intervals
from diff4splat.render.physical.ray_batches import MovingScene, geometry, middle_s
from diff4splat.render.physical.sampling import draw
from diff4splat.render.physical.sensor import Draws, SensorRays, sensor_rays
from diff4splat.render.physical.sensor_rows import line_of
from diff4splat.render.physical.settings import GEOMETRY, Photograph, PhotoSettings
from diff4splat.render.physical.view_cone import view_cone
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

BYTES_PER_RAY = 512
"""Memory of a traced ray, generously."""
_OF_DISTANCE = {"distance": "distance", "depth": "distance", "median_depth": "median_distance"}
Images = dict[str, Float[Tensor, "p ..."] | Bool[Tensor, " p"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposure:
    """One image, to be traced."""

    subject: Scene | Gaussians
    camera: PhysicalCamera
    time_s: float
    settings: PhotoSettings
    effects: Effects

    def take(self, outputs: frozenset[str]) -> Photograph:
        """The images named in ``outputs``."""
        subject = self._subject()
        pixels = self._in_reading_order()
        parts = []
        for own in pixels.split(self._pixels_at_once()):
            parts.append(self._part(subject, own, outputs))
            if len(own) < len(pixels):
                self._require_room(parts[-1], len(pixels))
        order = pixels.argsort()
        size_px = self.camera.camera.size_px
        images = {
            name: torch.cat([part[name] for part in parts])[order].unflatten(0, size_px)
            for name in parts[0]
        }
        return Photograph(
            **images,
            samples=self.effects.samples,
            intervals=len(subject.intervals),
            interval_error_px=subject.intervals.error_px,
            skipped_effects=self.effects.skipped_effects,
            dropped_nonfinite=subject.dropped,
        )

    def _subject(self) -> MovingScene:
        middle = middle_s(self.camera.optics, self.time_s)
        cone = view_cone(self.camera, middle)
        first, last = (edge - self.time_s for edge in self.camera.optics.window_s(self.time_s))
        intervals = Intervals((first, last), 0.0)
        if self.effects.scene_moves and isinstance(self.subject, Scene):
            intervals = choose_intervals(
                self.subject, self.camera, self.time_s, cone, self.settings
            )
        return MovingScene(
            scene=self.subject,
            time_s=self.time_s,
            intervals=intervals,
            cone=cone,
            settings=self.settings,
            moves=self.effects.scene_moves,
        )

    def _in_reading_order(self) -> Int[Tensor, " p"]:
        """All pixels, line by line: neighbours are exposed at about the same time."""
        camera, shutter = self.camera.camera, self.camera.optics.shutter
        pixels = torch.arange(camera.size_px[0] * camera.size_px[1], device=camera.focal_px.device)
        if shutter is None:
            return pixels
        return pixels[line_of(pixels, camera.size_px, shutter.direction).argsort(stable=True)]

    def _pixels_at_once(self) -> int:
        return max(self.settings.memory_bytes // (BYTES_PER_RAY * self.effects.samples), 1)

    def _require_room(self, part: Images, pixels: int) -> None:
        """All rays with gradients stay in memory until the backward pass.

        Raises:
            InputError: they do not fit in memory.
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
        self, subject: MovingScene, pixels: Int[Tensor, " p"], outputs: frozenset[str]
    ) -> Images:
        """The outputs of some pixels."""
        middle, blended = self._rays(pixels, Draws()), outputs - GEOMETRY
        valid, single_ray = middle.exists[:, 0], outputs
        own: Images = {}
        if self.effects.scatters:
            own, covered = self._blended(subject, pixels, blended)
            valid, single_ray = valid & covered, outputs & GEOMETRY
        wanted = _traced(single_ray)
        traced = subject.trace(middle, wanted) if wanted else {}
        own |= {name: traced[name] for name in blended & wanted} | geometry(
            traced, middle, single_ray
        )
        return {name: _masked(value, valid) for name, value in own.items()} | {"valid": valid}

    def _blended(
        self, subject: MovingScene, pixels: Int[Tensor, " p"], outputs: frozenset[str]
    ) -> tuple[Images, Bool[Tensor, " p"]]:
        """Means over the valid samples, and which pixels have any."""
        rays = self._rays(pixels, draw(self.effects, pixels, self.settings.seed))
        count = rays.exists.sum(1)
        if not outputs:
            return {}, count > 0
        traced = subject.trace(rays, outputs)
        totals = {k: value.unflatten(0, rays.exists.shape).sum(1) for k, value in traced.items()}
        divisor = count.clamp_min(1).to(rays.origins)
        means = {k: v / divisor.view(-1, *(1,) * (v.ndim - 1)) for k, v in totals.items()}
        return means, count > 0

    def _rays(self, pixels: Int[Tensor, " p"], draws: Draws) -> SensorRays:
        return sensor_rays(self.camera, pixels, draws, self.time_s, self.effects.rolls)


def _traced(outputs: frozenset[str]) -> frozenset[str]:
    """Outputs that the tracer must compute."""
    return frozenset(_OF_DISTANCE.get(name, name) for name in outputs if name != "time_s")


def _masked(values: Float[Tensor, "p ..."], valid: Bool[Tensor, " p"]) -> Float[Tensor, "p ..."]:
    """The values, 0 in invalid pixels."""
    return torch.where(valid.view(-1, *(1,) * (values.ndim - 1)), values, 0.0)
