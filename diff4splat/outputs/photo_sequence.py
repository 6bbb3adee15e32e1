"""Render the frames of a physical camera path one by one, and collect statistics.

Axes: ``h w`` pixels. Only one frame is in memory.
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
"""Smallest cosine to the optical axis for which z-depth is meaningful."""


@dataclass(slots=True)
class CaptureStats:
    """Statistics of a rendered sequence, updated with every frame."""

    samples: int = 1
    intervals: int = 1
    interval_error_px: float = 0.0
    dropped: int = 0
    backends: list[str] = field(default_factory=list)
    skipped_effects: list[str] = field(default_factory=list)
    notes: tuple[str, ...] = ()
    """About the format of the file."""
    valid: Bool[Tensor, "h w"] | None = None
    """Pixels inside the field of view of the lens in every frame."""

    def add(self, photo: Photograph) -> None:
        """Update the statistics with one frame."""
        self.samples = max(self.samples, photo.samples)
        self.intervals = max(self.intervals, photo.intervals)
        self.interval_error_px = max(self.interval_error_px, photo.interval_error_px)
        self.dropped = max(self.dropped, photo.dropped_nonfinite)
        valid = photo.valid.cpu()
        self.valid = valid if self.valid is None else self.valid & valid
        for names, new in (
            (self.backends, [photo.backend]),
            (self.skipped_effects, photo.skipped_effects),
        ):
            names.extend(name for name in new if name not in names)

    @property
    def blind_share(self) -> float:
        """Fraction of the image outside the field of view of the lens."""
        return 0.0 if self.valid is None else 1 - float(self.valid.float().mean())

    def lines(self) -> list[str]:
        """One line of statistics, then one line per skipped effect."""
        if "trace" in self.backends:
            facts = (
                f"{_counted(self.samples, 'ray')} per pixel; time split into "
                f"{_counted(self.intervals, 'interval')} per image, at most "
                f"{self.interval_error_px:.2g} px off"
            )
        else:
            facts = "no effect of the camera shows: drawn as a pinhole"
        if self.blind_share > 0:
            facts += f"; the lens sees nothing in {100 * self.blind_share:.1f} % of the image"
        lines = [facts, *(f"left out: {what}" for what in self.skipped_effects)]
        if self.dropped:
            lines.append(f"left out: {self.dropped:,} Gaussians that are not finite or too large")
        return [*lines, *self.notes]


def render_photographs(
    scene: Scene,
    physical_path: PhysicalPath,
    outputs: Collection[str],
    settings: PhotoSettings,
    advance: Callable[[], None],
    stats: CaptureStats,
) -> Iterator[Photograph]:
    """Render the frames of ``physical_path`` lazily, and add each to ``stats``."""
    for index in range(len(physical_path)):
        with torch.no_grad():
            photo = photograph(
                scene,
                physical_path.camera(index),
                physical_path.time_s(index),
                outputs=outputs,
                settings=settings,
            )
        stats.add(photo)
        advance()
        yield photo


def freeze_time(scene: Scene, time_s: float | None) -> Scene:
    """``scene`` fixed at ``time_s``; unchanged if that is None."""
    if time_s is None:
        return scene
    return replace(scene, gaussians=scene.state_at(time_s), motion=StaticMotion())


def needs_rays(scene: Scene, physical_path: PhysicalPath, settings: PhotoSettings) -> bool:
    """Whether any frame has an effect that the rasteriser cannot render."""
    return any(
        find_effects(scene, physical_path.camera(index), physical_path.time_s(index), settings).any
        for index in range(len(physical_path))
    )


def geometry_kind(physical_path: PhysicalPath) -> GeometryKind:
    """``depth``, or ``distance`` for a lens with rays at a right angle or more to its axis."""
    camera = physical_path.path.cameras[0]
    height, width = camera.size_px
    rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    pixels = torch.stack([columns, rows], -1).double() + 0.5
    directions, exists = sensor_directions(camera, physical_path.optics.lens, pixels)
    is_sideways = exists & (directions[..., 2] < MIN_FORWARD_COSINE)
    return "distance" if bool(is_sideways.any()) else "depth"


def _counted(count: int, name: str) -> str:
    return f"{count} {name}{'s' * (count != 1)}"
