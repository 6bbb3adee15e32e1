"""From options to optics: apertures, focus, shutters, and sampling."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from diff4splat.cli.lens_choice import SENSOR_MM, lens_of
from diff4splat.cli.optics_options import (
    OpticsOptions,
    flag,
    require_consistent,
    require_numbers,
)
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from diff4splat.geometry.optics import Aperture, Shutter
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.physical_path import PhysicalPath
    from diff4splat.render.physical.settings import PhotoSettings
    from diff4splat.scene.scene import Scene

EASY_APERTURE = 0.02
"""Radius of a data set's aperture in focus distances: far away blurs by that share of f_x."""
HALF_FRAME = 0.5
"""Share of the time between frames that a data set's read-out takes, and its exposure."""
LONE_FRAME_S = 1 / 24
"""Time between frames where there is one frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Focus:
    """What the lens is focused at."""

    distance: float
    note: str | None = None
    """Where the distance came from, when nobody gave it."""


def choose_optics(
    scene: "Scene", path: "CameraPath", options: OpticsOptions
) -> tuple["PhysicalPath", tuple[str, ...]]:
    """``path`` through the camera of ``options``, and notes.

    Raises:
        ConfigError: options that contradict each other.
        InputError: a lens that cannot be, or a frame that is not over when the next begins.
    """
    from diff4splat.geometry.optics import Optics, require_frame_holds
    from diff4splat.paths.physical_path import filmed

    require_consistent(options)
    lens, lens_path = lens_of(options, path)
    aperture, notes = None, ()
    if options.has_aperture:
        aperture, notes = aperture_of(scene, path, options)
    made = filmed(
        lens_path,
        Optics(
            lens=lens,
            aperture=aperture,
            shutter=shutter_of(options) if options.rolls else None,
            exposure_s=options.exposure or 0.0,
        ),
    )
    require_frame_holds(made.optics, made.frame_s, "--readout, --exposure")
    return made, notes


def choose_effects(
    scene: "Scene", path: "CameraPath", options: OpticsOptions
) -> tuple["Mapping[str, PhysicalPath]", tuple[str, ...]]:
    """Every sequence of a data set by name, and notes; what is not given has a default.

    Raises:
        ConfigError: options that contradict each other, or a lens that is no fisheye.
        InputError: a lens that cannot be, or a frame that is not over when the next begins.
    """
    from diff4splat.outputs.camera_dataset.sequences import EffectChoice, effect_sequences

    full = _with_every_effect(options, path)
    lens, lens_path = lens_of(full, path)
    aperture, notes = aperture_of(scene, path, full)
    choice = EffectChoice(
        path=path,
        lens=lens,
        lens_path=lens_path,
        aperture=aperture,
        shutter=shutter_of(full),
        exposure_s=full.exposure or 0.0,
    )
    return effect_sequences(choice), notes


def photo_settings(options: OpticsOptions) -> "PhotoSettings":
    """How the pictures are taken."""
    from diff4splat.render.physical.settings import PhotoSettings

    given = {name: getattr(options, name) for name in ("rows_per_chunk", "tolerance_px", "seed")}
    return PhotoSettings(
        samples=options.samples,
        pixel_area=options.pixel_area,
        **{name: value for name, value in given.items() if value is not None},
    )


def aperture_of(
    scene: "Scene", path: "CameraPath", options: OpticsOptions
) -> tuple["Aperture", tuple[str, ...]]:
    """The thin lens, focused; and notes about what nobody said."""
    from diff4splat.geometry.optics import Aperture

    focus = Focus(distance=options.focus_distance or 0.0)
    if options.focus_distance is None:
        focus = middle_focus(scene, path)
    radius, notes = options.aperture_radius, [focus.note]
    if options.f_stop is not None:
        radius = radius_of_f_stop(options, path)
        notes.append(f"aperture: f/{options.f_stop:g} is a radius of {radius:.4g} scene units")
    elif radius is None:
        radius = EASY_APERTURE * focus.distance
        notes.append(f"aperture: a radius of {radius:.4g} scene units")
    aperture = Aperture(
        radius=radius, focus_distance=focus.distance, surface=options.focus_surface or "plane"
    )
    return aperture, tuple(note for note in notes if note)


def shutter_of(options: OpticsOptions) -> "Shutter":
    """Lines one after another."""
    from diff4splat.geometry.optics import Shutter

    return Shutter(readout_s=options.readout or 0.0, direction=options.shutter)


def radius_of_f_stop(options: OpticsOptions, path: "CameraPath") -> float:
    """Focal length / 2 N in scene units: f_mm = f_px · sensor_mm / longer side of the picture."""
    focal_px = float(path.cameras.focal_px[0, 0])
    sensor_mm = SENSOR_MM if options.sensor_size is None else options.sensor_size
    focal_mm = focal_px * sensor_mm / max(path.cameras.size_px)
    return focal_mm / (2 * options.f_stop) / 1000 / (options.metres_per_unit or 1.0)


def middle_focus(scene: "Scene", path: "CameraPath") -> Focus:
    """The depth that the first camera sees in the middle of its picture.

    Where it sees nothing there, the median depth of the scene.
    """
    from diff4splat.render.api import render
    from diff4splat.scene.extent import depth_range

    camera = path.cameras[0]
    column, row = (math.floor(value) for value in camera.center_px.tolist())
    pixel = camera.cropped((row, column), (1, 1))
    seen = render(scene, pixel, float(path.times_s[0]), outputs=("median_depth",)).median_depth
    depth = float(seen.detach()[0, 0])
    if depth > 0:
        return Focus(distance=depth, note=f"focus: {depth:.4g}, the depth in the middle of frame 0")
    depth = depth_range(scene).focus
    return Focus(
        distance=depth,
        note=f"focus: {depth:.4g}, the median depth, since frame 0 shows nothing in its middle",
    )


def _with_every_effect(options: OpticsOptions, path: "CameraPath") -> OpticsOptions:
    """The options of the sequence that has all effects.

    Raises:
        ConfigError: a number out of range, or a lens that is no fisheye.
    """
    lens = "fisheye" if options.lens == "pinhole" else options.lens
    if lens not in ("fisheye", "blender"):
        raise ConfigError(
            f"--dataset: expected --lens fisheye or blender for its fisheye, got {lens}"
        )
    if options.metres_per_unit is not None and options.f_stop is None:
        raise ConfigError(f"{flag('metres_per_unit')}: expected together with --f-stop")
    if options.sensor_size is not None and options.f_stop is None and lens != "blender":
        raise ConfigError(f"{flag('sensor_size')}: expected together with --f-stop or blender")
    steps = path.times_s.double().diff()
    half_s = HALF_FRAME * (float(steps.min()) if len(steps) else LONE_FRAME_S)
    full = replace(
        options,
        lens=lens,
        shutter=options.shutter if options.rolls else "top-to-bottom",
        readout=half_s if options.readout is None else options.readout,
        exposure=half_s if options.exposure is None else options.exposure,
    )
    require_numbers(full)
    return full
