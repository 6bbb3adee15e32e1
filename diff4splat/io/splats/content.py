"""What a reader of another program's file returns: Gaussians, and what goes with them."""

from dataclasses import dataclass

from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians


@dataclass(frozen=True, slots=True, kw_only=True)
class SplatContent:
    """Gaussians of one moment in our axes and units."""

    gaussians: Gaussians
    notes: tuple[str, ...] = ()
    """What the file holds and the Gaussians do not, in words."""
    camera: Camera | None = None
    """The camera that the file names, if any."""
    time_s: float | None = None
    """The time that the file names, if any."""
