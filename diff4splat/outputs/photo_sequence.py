"""A sequence of photographs, one at a time, and what they needed.

Axes: ``h w`` pixels. Memory holds one frame, however long the path is.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.geometry.lenses.sensor import sensor_directions
from diff4splat.io.cameras.camera_record import GeometryKind
from diff4splat.paths.physical_path import PhysicalPath
from diff4splat.render.physical.api import photograph
from diff4splat.render.physical.effects import find_effects
from diff4splat.render.physical.settings import Photograph, PhotoSettings
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

MIN_FORWARD_COSINE = 1e-3
"""Cosine with the axis below which z says nothing: a right angle, but for rounding."""


@dataclass(slots=True)
class CaptureStats:
    """What the photographs of a sequence were made of; grows while they are taken."""

    samples: int = 1
    intervals: int = 1
    interval_error_px: float = 0.0
    dropped: int = 0
    backends: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    valid: Bool[Tensor, "h w"] | None = None
    """Pixels that see something in every frame."""

    def add(self, photo: Photograph) -> None:
        """One more."""
        self.samples = max(self.samples, photo.samples)
        self.intervals = max(self.intervals, photo.intervals)
        self.interval_error_px = max(self.interval_error_px, photo.interval_error_px)
        self.dropped = max(self.dropped, photo.dropped_nonfinite)
        valid = photo.valid.cpu()
        self.valid = valid if self.valid is None else self.valid & valid
        for known, new in ((self.backends, [photo.backend]), (self.left_out, photo.left_out)):
            known.extend(name for name in new if name not in known)

    @property
    def blind_share(self) -> float:
        """Of the picture, where the lens sees nothing."""
        return 0.0 if self.valid is None else 1 - float(self.valid.float().mean())

    def lines(self) -> list[str]:
        """For people: one line of facts, then what was left out."""
        if "trace" in self.backends:
            facts = (
                f"{_counted(self.samples, 'ray')} per pixel; time split into "
                f"{_counted(self.intervals, 'interval')} per picture, at most "
                f"{self.interval_error_px:.2g} px off"
            )
        else:
            facts = "no effect of the camera shows: drawn as a pinhole"
        if self.blind_share > 0:
            facts += f"; the lens sees nothing in {100 * self.blind_share:.1f} % of the picture"
        lines = [facts, *(f"left out: {what}" for what in self.left_out)]
        if self.dropped:
            lines.append(f"left out: {self.dropped:,} Gaussians that are not finite or too large")
        return lines


def render_photographs(
    scene: Scene,
    filmed: PhysicalPath,
    outputs: Collection[str],
    settings: PhotoSettings,
    advance: Callable[[], None],
    taken: CaptureStats,
) -> Iterator[Photograph]:
    """Every frame of ``filmed`` when it is asked for; ``taken`` hears of each."""
    for index in range(len(filmed)):
        with torch.no_grad():
            photo = photograph(
                scene,
                filmed.camera(index),
                filmed.time_s(index),
                outputs=outputs,
                settings=settings,
            )
        taken.add(photo)
        advance()
        yield photo


def freeze_time(scene: Scene, time_s: float | None) -> Scene:
    """``scene`` with its clock standing still at ``time_s``; as it is without one."""
    if time_s is None:
        return scene
    return replace(scene, gaussians=scene.state_at(time_s), motion=StaticMotion())


def needs_rays(scene: Scene, filmed: PhysicalPath, settings: PhotoSettings) -> bool:
    """Whether any frame has an effect that the rasteriser cannot draw."""
    return any(
        find_effects(scene, filmed.camera(index), filmed.time_s(index), settings).any
        for index in range(len(filmed))
    )


def geometry_kind(filmed: PhysicalPath) -> GeometryKind:
    """Depth, or distance for a lens that looks sideways or behind itself: z is no measure there."""
    camera = filmed.path.cameras[0]
    height, width = camera.size_px
    rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    pixels = torch.stack([columns, rows], -1).double() + 0.5
    directions, exists = sensor_directions(camera, filmed.optics.lens, pixels)
    behind = exists & (directions[..., 2] < MIN_FORWARD_COSINE)
    return "distance" if bool(behind.any()) else "depth"


def _counted(count: int, name: str) -> str:
    return f"{count} {name}{'s' * (count != 1)}"
