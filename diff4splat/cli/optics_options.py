"""Lens, aperture, shutter and exposure on the command line, and which of them belong together."""

import math
from dataclasses import dataclass
from typing import Literal

from diff4splat.errors import ConfigError

LensName = Literal["pinhole", "opencv", "fisheye", "blender", "equirectangular"]
SurfaceName = Literal["plane", "sphere"]
ShutterName = Literal["global", "top-to-bottom", "bottom-to-top", "left-to-right", "right-to-left"]
WITH_FOCAL_LENGTH = ("pinhole", "opencv")
"""Lenses that keep the focal length of the camera path."""
COEFFICIENTS = {"opencv": (4, 5, 8, 12), "fisheye": (4,), "blender": (5,)}
"""How many numbers a lens takes."""


@dataclass(frozen=True, kw_only=True)
class OpticsOptions:
    """A camera as it is built, in place of a pinhole."""

    lens: LensName = "pinhole"
    """What bends the picture. Equirectangular pictures are twice as wide as high."""
    lens_coefficients: tuple[float, ...] = ()
    """opencv: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]]; fisheye: k1 k2 k3 k4; blender: k0 k1 k2 k3
    k4 in rad/mm^i, all negated as in Cycles or not. If left out: barrel distortion, equidistant, a
    wide lens."""
    fov: float | None = None
    """Field of view of a fisheye or blender lens in degrees, blind beyond; a fisheye's spans the
    width. If left out, 180."""
    f_stop: float | None = None
    """Aperture as f-number, for lenses with a focal length."""
    aperture_radius: float | None = None
    """Aperture as radius in scene units."""
    focus_distance: float | None = None
    """In scene units; if left out, the depth in the middle of the first frame."""
    focus_surface: SurfaceName | None = None
    """What is in focus; if left out, a plane, as with real lenses."""
    sensor_size: float | None = None
    """Longer side of the sensor in millimetres, for --f-stop and blender; if left out, 36."""
    metres_per_unit: float | None = None
    """Metres in a scene unit, for --f-stop; if left out, 1."""
    shutter: ShutterName = "global"
    """In which order lines are read out, or all at once."""
    readout: float | None = None
    """Seconds from the first line to the last."""
    exposure: float | None = None
    """Seconds that each line sees."""
    samples: int | None = None
    """Rays per pixel; if left out, 64 with an aperture, else 16 where there is something to
    average."""
    pixel_area: bool = False
    """Average over the square of a pixel in place of its middle."""
    rows_per_chunk: int | None = None
    """Lines that see the scene at one time, in place of --tolerance-px."""
    tolerance_px: float | None = None
    """How far anything may be from its place at the time of a line; if left out, 0.1."""
    seed: int | None = None
    """Of the samples; if left out, 0."""

    @property
    def has_aperture(self) -> bool:
        """Whether there is depth of field."""
        return self.f_stop is not None or self.aperture_radius is not None

    @property
    def rolls(self) -> bool:
        """Whether lines are read one after another."""
        return self.shutter != "global"


def require_consistent(options: OpticsOptions) -> None:
    """Refuse numbers out of range, and options without those that give them a meaning.

    Raises:
        ConfigError: naming both.
    """
    require_numbers(options)
    if options.f_stop is not None and options.lens not in WITH_FOCAL_LENGTH:
        raise ConfigError(
            f"--f-stop: expected a lens with a focal length ({', '.join(WITH_FOCAL_LENGTH)}), got "
            f"{options.lens}; give --aperture-radius"
        )
    if options.rolls and options.readout is None:
        raise ConfigError(f"--shutter {options.shutter}: expected with --readout; give its seconds")
    averages = options.has_aperture or options.exposure is not None or options.pixel_area
    moves = options.rolls or options.exposure is not None
    aperture, time = "--f-stop or --aperture-radius", "--shutter or --exposure"
    needs = {
        "fov": (options.lens in ("fisheye", "blender"), "--lens fisheye or blender"),
        "focus_distance": (options.has_aperture, aperture),
        "focus_surface": (options.has_aperture, aperture),
        "sensor_size": (
            options.f_stop is not None or options.lens == "blender",
            "--f-stop or --lens blender",
        ),
        "metres_per_unit": (options.f_stop is not None, "--f-stop"),
        "readout": (options.rolls, "--shutter, and one that is not global"),
        "rows_per_chunk": (moves, time),
        "tolerance_px": (moves, time),
        "samples": (averages, f"{aperture}, --exposure or --pixel-area"),
        "seed": (averages, f"{aperture}, --exposure or --pixel-area"),
    }
    for name, (there, what) in needs.items():
        if getattr(options, name) is not None and not there:
            raise ConfigError(f"{flag(name)}: expected together with {what}; give that too")


def require_numbers(options: OpticsOptions) -> None:
    """Refuse what is wrong whatever else was given.

    Raises:
        ConfigError: a number out of range, another number of coefficients, or two apertures.
    """
    if options.f_stop is not None and options.aperture_radius is not None:
        raise ConfigError("--f-stop, --aperture-radius: expected one of them, got both")
    for name in ("fov", "f_stop", "focus_distance", "sensor_size", "metres_per_unit"):
        _require_least(options, name, 0.0, above=True)
    _require_least(options, "tolerance_px", 0.0, above=True)
    for name in ("aperture_radius", "readout", "exposure", "seed"):
        _require_least(options, name, 0.0)
    for name in ("samples", "rows_per_chunk"):
        _require_least(options, name, 1.0)
    if options.fov is not None and options.fov > 360:
        raise ConfigError(f"--fov: expected at most 360 degrees, got {options.fov:g}")
    _require_coefficients(options)


def flag(name: str) -> str:
    """As it is typed."""
    return f"--{name.replace('_', '-')}"


def _require_least(options: OpticsOptions, name: str, least: float, above: bool = False) -> None:
    value = getattr(options, name)
    if value is None:
        return
    if not math.isfinite(value) or value < least or (above and value == least):
        bound = f"a finite number {'above' if above else 'of at least'} {least:g}"
        raise ConfigError(f"{flag(name)}: expected {bound}, got {value:g}")


def _require_coefficients(options: OpticsOptions) -> None:
    given, takes = options.lens_coefficients, COEFFICIENTS.get(options.lens, ())
    if not given:
        return
    if not takes:
        raise ConfigError(
            f"--lens-coefficients: expected with --lens {', '.join(COEFFICIENTS)}, got the lens "
            f"{options.lens}; name the lens"
        )
    if len(given) not in takes:
        counts = " or ".join(map(str, takes))
        raise ConfigError(
            f"--lens-coefficients: expected {counts} numbers for {options.lens}, got {len(given)}"
        )
    if not all(map(math.isfinite, given)):
        raise ConfigError(f"--lens-coefficients: expected finite numbers, got {given}")
