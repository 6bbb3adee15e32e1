"""Physical cameras along a path, and sampling settings, from the command line options."""

from dataclasses import replace
from typing import TYPE_CHECKING

from diff4splat.cli.options.aperture import build_aperture, build_shutter
from diff4splat.cli.options.lens import build_lens
from diff4splat.cli.options.optics import (
    OpticsOptions,
    flag,
    require_consistent,
    require_numbers,
)
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.physical_path import PhysicalPath
    from diff4splat.render.physical.settings import PhotoSettings
    from diff4splat.scene.scene import Scene

FRAME_SHARE = 0.5
"""Default read-out time and exposure of a data set, as a share of the frame interval."""
DEFAULT_FRAME_S = 1 / 24
"""Frame interval in seconds of a path with one frame."""


def choose_optics(
    scene: "Scene", path: "CameraPath", options: OpticsOptions
) -> tuple["PhysicalPath", tuple[str, ...]]:
    """``path`` with the physical camera of ``options``, and notes.

    Raises:
        ConfigError: options that contradict each other.
        InputError: an impossible lens, or a frame that overlaps the next one.
    """
    from diff4splat.geometry.optics import Optics, require_frame_holds
    from diff4splat.paths.physical_path import filmed

    require_consistent(options)
    lens, lens_path = build_lens(options, path)
    aperture, notes = None, ()
    if options.has_aperture:
        aperture, notes = build_aperture(scene, path, options)
    physical_path = filmed(
        lens_path,
        Optics(
            lens=lens,
            aperture=aperture,
            shutter=build_shutter(options) if options.rolls else None,
            exposure_s=options.exposure or 0.0,
        ),
    )
    require_frame_holds(physical_path.optics, physical_path.frame_s, "--readout, --exposure")
    return physical_path, notes


def choose_effects(
    scene: "Scene", path: "CameraPath", options: OpticsOptions
) -> tuple["Mapping[str, PhysicalPath]", tuple[str, ...]]:
    """Every sequence of a data set by name, and notes; missing options get defaults.

    Raises:
        ConfigError: options that contradict each other, or a lens that is no fisheye.
        InputError: an impossible lens, or a frame that overlaps the next one.
    """
    from diff4splat.outputs.camera_dataset.sequences import EffectChoice, effect_sequences

    full = _with_every_effect(options, path)
    lens, lens_path = build_lens(full, path)
    aperture, notes = build_aperture(scene, path, full)
    choice = EffectChoice(
        path=path,
        lens=lens,
        lens_path=lens_path,
        aperture=aperture,
        shutter=build_shutter(full),
        exposure_s=full.exposure or 0.0,
    )
    return effect_sequences(choice), notes


def to_photo_settings(options: OpticsOptions) -> "PhotoSettings":
    """Sampling settings of the images."""
    from diff4splat.render.physical.settings import PhotoSettings

    given = {name: getattr(options, name) for name in ("rows_per_chunk", "tolerance_px", "seed")}
    return PhotoSettings(
        samples=options.samples,
        pixel_area=options.pixel_area,
        **{name: value for name, value in given.items() if value is not None},
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
    half_s = FRAME_SHARE * (float(steps.min()) if len(steps) else DEFAULT_FRAME_S)
    full = replace(
        options,
        lens=lens,
        shutter=options.shutter if options.rolls else "top-to-bottom",
        readout=half_s if options.readout is None else options.readout,
        exposure=half_s if options.exposure is None else options.exposure,
    )
    require_numbers(full)
    return full
