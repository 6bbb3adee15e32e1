"""Which effects an image has, given its camera and its scene; the others are left out and named.

A lens that bends nothing, an aperture of radius 0, and a shutter or an exposure while nothing moves
change no pixel. A camera with no effect at all is a pinhole, which the rasteriser draws faster.
"""

import math
from dataclasses import dataclass, field

import torch

from diff4splat.geometry.lenses.opencv_pinhole import OpenCVPinhole
from diff4splat.geometry.lenses.pinhole import Pinhole
from diff4splat.geometry.lenses.protocol import Lens
from diff4splat.geometry.optics import Number, as_float, is_learned
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.settings import (
    EXPOSURE_SAMPLES,
    LENS_SAMPLES,
    PIXEL_SAMPLES,
    PhotoSettings,
)
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """What an image needs."""

    bends: bool
    """The lens is no pinhole."""
    spreads: bool
    """Rays of a pixel start all over an aperture."""
    rolls: bool
    """Lines are read at times that differ, and that shows."""
    exposes: bool
    """Rays of a pixel have times that differ, and that shows."""
    scene_moves: bool
    """While the image is taken."""
    covers: bool
    """Rays of a pixel go through all of its square."""
    samples: int
    skipped_effects: tuple[str, ...] = field(default=())

    @property
    def scatters(self) -> bool:
        """Whether rays of a pixel differ."""
        return self.spreads or self.exposes or self.covers

    @property
    def any(self) -> bool:
        """Whether rays are needed."""
        return self.bends or self.rolls or self.scatters


def find_effects(
    subject: Scene | Gaussians, camera: PhysicalCamera, time_s: float, settings: PhotoSettings
) -> Effects:
    """The effects that show in an image of ``subject`` at ``time_s``."""
    optics, skipped_effects = camera.optics, []
    aperture, shutter = optics.aperture, optics.shutter
    bends = not is_pinhole(optics.lens)
    spreads = aperture is not None and counts(aperture.radius)
    if not bends and not isinstance(optics.lens, Pinhole):
        skipped_effects.append("distortion: all coefficients are 0")
    if aperture is not None and not spreads:
        skipped_effects.append("aperture: its radius is 0")
    # What is learned may grow to any size.
    learned = is_learned(optics.exposure_s) or (shutter and is_learned(shutter.readout_s))
    window = (-math.inf, math.inf) if learned else optics.window_s(time_s)
    scene_moves = _moves(subject, window)
    moves = scene_moves or camera.is_moving_between(*window)
    rolls = shutter is not None and counts(shutter.readout_s)
    exposes = counts(optics.exposure_s)
    if not moves and (rolls or exposes):
        names = " and ".join(
            name for name, there in (("read-out", rolls), ("exposure", exposes)) if there
        )
        skipped_effects.append(f"{names}: neither scene nor camera moves meanwhile")
    rolls, exposes = rolls and moves, exposes and moves
    spread_over = spreads or exposes or settings.pixel_area
    samples = _samples(settings, spreads, exposes) if spread_over else 1
    if settings.samples is not None and settings.samples > samples:
        skipped_effects.append(
            f"{settings.samples} samples per pixel: all rays of a pixel are the same"
        )
    return Effects(
        bends=bends,
        spreads=spreads,
        rolls=rolls,
        exposes=exposes,
        scene_moves=scene_moves and (rolls or exposes),
        covers=settings.pixel_area,
        samples=samples,
        skipped_effects=tuple(skipped_effects),
    )


def counts(number: Number) -> bool:
    """Whether it is not 0, or will not be."""
    return as_float(number) > 0 or is_learned(number)


def is_pinhole(lens: Lens) -> bool:
    """Whether a lens bends nothing, and is not about to learn to."""
    if isinstance(lens, OpenCVPinhole):
        terms = torch.cat([lens.radial, lens.tangential, lens.thin_prism])
        return not terms.requires_grad and not bool(terms.any())
    return isinstance(lens, Pinhole)


def _samples(settings: PhotoSettings, spreads: bool, exposes: bool) -> int:
    if settings.samples is not None:
        return settings.samples
    if spreads:
        return LENS_SAMPLES
    return EXPOSURE_SAMPLES if exposes else PIXEL_SAMPLES


def _moves(subject: Scene | Gaussians, window: tuple[float, float]) -> bool:
    """Whether the scene is not the same in all of a stretch of time."""
    if isinstance(subject, Gaussians) or len(subject.motion.moving_index) == 0:
        return False
    start, stop = subject.motion.time_range_s
    lasts = start < stop and window[0] < window[1]
    return lasts and window[0] < stop and window[1] > start
