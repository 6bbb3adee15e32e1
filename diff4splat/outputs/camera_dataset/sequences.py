"""The sequences of a data set: a pinhole, each effect alone, and all of them together."""

from collections.abc import Mapping
from dataclasses import dataclass

from diff4splat.geometry.lenses.protocol import Lens
from diff4splat.geometry.optics import Aperture, Optics, Shutter, require_frame_holds
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.physical_path import PhysicalPath, filmed

EFFECTS = ("pinhole", "fisheye", "depth-of-field", "rolling-shutter", "motion-blur", "combined")
"""In the order of the contact sheet; also the names of the folders."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectChoice:
    """How strong each effect is."""

    path: CameraPath
    """Of the pinhole; the other effects are seen from its poses at its times."""
    lens: Lens
    lens_path: CameraPath
    """``path`` with the focal lengths that ``lens`` needs."""
    aperture: Aperture
    shutter: Shutter
    exposure_s: float


def effect_sequences(choice: EffectChoice) -> Mapping[str, PhysicalPath]:
    """What to film, by the names in ``EFFECTS``.

    Raises:
        InputError: read-out and exposure together are longer than a frame.
    """
    aperture, shutter, exposure_s = choice.aperture, choice.shutter, choice.exposure_s
    bent = {
        "fisheye": Optics(lens=choice.lens),
        "combined": Optics(
            lens=choice.lens, aperture=aperture, shutter=shutter, exposure_s=exposure_s
        ),
    }
    straight = {
        "pinhole": Optics(),
        "depth-of-field": Optics(aperture=aperture),
        "rolling-shutter": Optics(shutter=shutter),
        "motion-blur": Optics(exposure_s=exposure_s),
    }
    made = {name: filmed(choice.lens_path, optics) for name, optics in bent.items()}
    made |= {name: filmed(choice.path, optics) for name, optics in straight.items()}
    for name, one in made.items():
        require_frame_holds(one.optics, one.frame_s, name)
    return {name: made[name] for name in EFFECTS}
