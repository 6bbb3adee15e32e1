"""Aperture, focus and shutter from the command line options."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from diff4splat.cli.options.lens import SENSOR_MM
from diff4splat.cli.options.optics import OpticsOptions

if TYPE_CHECKING:
    from diff4splat.geometry.optics import Aperture, Shutter
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.scene.scene import Scene

DEFAULT_RELATIVE_APERTURE = 0.02
"""Default aperture radius of a data set, as a share of the focus distance.

Points at infinity blur by that share of f_x.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Focus:
    """Focus distance in scene units."""

    distance: float
    note: str | None = None
    """How the distance was chosen; None if an option gave it."""


def build_aperture(
    scene: "Scene", path: "CameraPath", options: OpticsOptions
) -> tuple["Aperture", tuple[str, ...]]:
    """The aperture, and notes on the values that no option gave."""
    from diff4splat.geometry.optics import Aperture

    focus = Focus(distance=options.focus_distance or 0.0)
    if options.focus_distance is None:
        focus = central_focus(scene, path)
    radius, notes = options.aperture_radius, [focus.note]
    if options.f_stop is not None:
        radius = f_stop_radius(options, path)
        notes.append(f"aperture: f/{options.f_stop:g} is a radius of {radius:.4g} scene units")
    elif radius is None:
        radius = DEFAULT_RELATIVE_APERTURE * focus.distance
        notes.append(f"aperture: a radius of {radius:.4g} scene units")
    aperture = Aperture(
        radius=radius, focus_distance=focus.distance, surface=options.focus_surface or "plane"
    )
    return aperture, tuple(note for note in notes if note)


def build_shutter(options: OpticsOptions) -> "Shutter":
    """The rolling shutter of the options."""
    from diff4splat.geometry.optics import Shutter

    return Shutter(readout_s=options.readout or 0.0, direction=options.shutter)


def f_stop_radius(options: OpticsOptions, path: "CameraPath") -> float:
    """Focal length / 2 N in scene units: f_mm = f_px · sensor_mm / longer image side."""
    focal_px = float(path.cameras.focal_px[0, 0])
    sensor_mm = SENSOR_MM if options.sensor_size is None else options.sensor_size
    focal_mm = focal_px * sensor_mm / max(path.cameras.size_px)
    return focal_mm / (2 * options.f_stop) / 1000 / (options.metres_per_unit or 1.0)


def central_focus(scene: "Scene", path: "CameraPath") -> Focus:
    """The depth at the centre of the first frame.

    The focus depth of the scene, if no Gaussian covers that pixel.
    """
    from diff4splat.render.api import render
    from diff4splat.scene.extent import depth_range

    camera = path.cameras[0]
    column, row = (math.floor(value) for value in camera.center_px.tolist())
    pixel = camera.cropped((row, column), (1, 1))
    rendered = render(scene, pixel, float(path.times_s[0]), outputs=("median_depth",))
    depth = float(rendered.median_depth.detach()[0, 0])
    if depth > 0:
        return Focus(distance=depth, note=f"focus: {depth:.4g}, the depth in the middle of frame 0")
    depth = depth_range(scene).focus
    return Focus(
        distance=depth,
        note=f"focus: {depth:.4g}, the focus depth, since frame 0 shows nothing in its middle",
    )
