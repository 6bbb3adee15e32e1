"""``diff4splat render`` with a physical camera: one file, or a data set of all effects."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.optics_options import OpticsOptions

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.physical_path import PhysicalPath
    from diff4splat.progress.phases import Phases
    from diff4splat.progress.run_log import RunLog
    from diff4splat.render.physical.settings import PhotoSettings
    from diff4splat.scene.scene import Scene


def film_file(
    scene: "Scene",
    path: "CameraPath",
    options: OpticsOptions,
    out: Path,
    frame: int,
    log: "RunLog",
) -> None:
    """Look along ``path`` through the camera of ``options``, into one file.

    A single picture (.png) is ``frame`` of it.
    """
    from diff4splat.cli.console import note
    from diff4splat.cli.optics_choice import choose_optics, photo_settings
    from diff4splat.outputs.physical_view import require_view_suffix, write_physical_view

    suffix = require_view_suffix(out)
    filmed, notes = choose_optics(scene, path, options)
    for line in notes:
        note(line)
    if suffix == ".png":
        filmed = one_frame(filmed, frame)
    settings = photo_settings(options)
    prepare(scene, [filmed], settings, log.phases)
    taken = write_physical_view(scene, filmed, out, settings, log)
    for line in taken.lines():
        note(line)
    if suffix == ".exr" and _looks_behind(filmed):
        note("the lens looks sideways or behind itself: distance along the ray, not z-depth")


def film_dataset(
    scene: "Scene",
    path: "CameraPath",
    options: OpticsOptions,
    out: Path,
    time_s: float | None,
    log: "RunLog",
) -> None:
    """Every effect alone and all together, as folders in ``out``."""
    from diff4splat.cli.console import note
    from diff4splat.cli.optics_choice import choose_effects, photo_settings
    from diff4splat.outputs.camera_dataset.writer import (
        DatasetJob,
        require_empty,
        write_camera_dataset,
    )
    from diff4splat.outputs.photographs import stopped

    require_empty(out)
    sequences, notes = choose_effects(stopped(scene, time_s), path, options)
    for line in notes:
        note(line)
    settings = photo_settings(options)
    prepare(scene, sequences.values(), settings, log.phases)
    job = DatasetJob(scene=scene, sequences=sequences, settings=settings, time_s=time_s)
    taken = write_camera_dataset(job, out, log)
    for name, own in taken.items():
        note(f"{name}: {'; '.join(own.lines())}")


def prepare(
    scene: "Scene",
    sequences: "Iterable[PhysicalPath]",
    settings: "PhotoSettings",
    phases: "Phases",
) -> None:
    """Compile what will draw, with a progress bar, unless that is done."""
    from diff4splat.cli.precompile import precompile_renderer, precompile_tracer
    from diff4splat.outputs.photographs import needs_rays

    traced = [needs_rays(scene, filmed, settings) for filmed in sequences]
    if any(traced):
        precompile_tracer(phases)
    if not all(traced):
        precompile_renderer(scene.gaussians, phases)


def one_frame(filmed: "PhysicalPath", frame: int) -> "PhysicalPath":
    """The path that shows one of its frames; the camera comes from where it was and goes on."""
    from diff4splat.cli.render import one_pose

    return replace(filmed, path=one_pose(filmed.path, frame))


def _looks_behind(filmed: "PhysicalPath") -> bool:
    from diff4splat.outputs.photographs import geometry_kind

    return geometry_kind(filmed) == "distance"
