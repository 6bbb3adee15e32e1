"""Command line options for lens, aperture, shutter and exposure, and their checks."""

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
"""Allowed numbers of coefficients per lens."""


@dataclass(frozen=True, kw_only=True)
class OpticsOptions:
    """A physical camera instead of a pinhole."""

    lens: LensName = "pinhole"
    """Lens model. Equirectangular images are twice as wide as high."""
    lens_coefficients: tuple[float, ...] = ()
    """opencv: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]]; fisheye: k1 k2 k3 k4; blender: k0 k1 k2 k3
    k4 in rad/mm^i, with either sign convention of Cycles. Default: barrel distortion (opencv),
    equidistant (fisheye), a wide lens (blender)."""
    fov: float | None = None
    """Field of view of a fisheye or blender lens in degrees; black outside. A fisheye's spans the
    image width. Default: 180."""
    f_stop: float | None = None
    """Aperture as f-number, for lenses with a focal length."""
    aperture_radius: float | None = None
    """Aperture radius in scene units."""
    focus_distance: float | None = None
    """Focus distance in scene units. Default: the depth at the centre of the first frame."""
    focus_surface: SurfaceName | None = None
    """Shape of the surface in focus. Default: plane, as with real lenses."""
    sensor_size: float | None = None
    """Longer side of the sensor in millimetres, for --f-stop and blender. Default: 36."""
    metres_per_unit: float | None = None
    """Metres per scene unit, for --f-stop. Default: 1."""
    shutter: ShutterName = "global"
    """Direction of the rolling shutter, or global."""
    readout: float | None = None
    """Read-out time from the first line to the last, in seconds."""
    exposure: float | None = None
    """Exposure time of each line, in seconds."""
    samples: int | None = None
    """Samples per pixel. Default: 64 with an aperture, 16 with exposure time or --pixel-area."""
    pixel_area: bool = False
    """Integrate over the pixel area instead of sampling its centre."""
    rows_per_chunk: int | None = None
    """Sensor lines rendered at one time, instead of --tolerance-px."""
    tolerance_px: float | None = None
    """Largest position error from rendering several lines at one time. Default: 0.1."""
    seed: int | None = None
    """Random seed of the samples. Default: 0."""

    @property
    def has_aperture(self) -> bool:
        """Whether the camera has depth of field."""
        return self.f_stop is not None or self.aperture_radius is not None

    @property
    def rolls(self) -> bool:
        """Whether the shutter is a rolling shutter."""
        return self.shutter != "global"


def require_consistent(options: OpticsOptions) -> None:
    """Reject values out of range, and options without the options they need.

    Raises:
        ConfigError: with the names of both options.
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
    for name, (is_given, what) in needs.items():
        if getattr(options, name) is not None and not is_given:
            raise ConfigError(f"{flag(name)}: expected together with {what}; give that too")


def require_numbers(options: OpticsOptions) -> None:
    """Reject single values out of range.

    Raises:
        ConfigError: a value out of range, a wrong number of coefficients, or two apertures.
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
    """The flag of a field."""
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
