"""``diff4splat render`` with a physical camera: one file, or a data set of all effects."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.options.optics import OpticsOptions
from diff4splat.cli.options.single_frame import select_physical_frame

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.paths.physical_path import PhysicalPath
    from diff4splat.progress.phases import Phases
    from diff4splat.progress.run_log import RunLog
    from diff4splat.render.physical.settings import PhotoSettings
    from diff4splat.scene.scene import Scene


def render_file(
    scene: "Scene",
    path: "CameraPath",
    options: OpticsOptions,
    out: Path,
    frame: int,
    log: "RunLog",
) -> None:
    """Render ``path`` with the camera of ``options`` into one file.

    A PNG holds only ``frame``.
    """
    from diff4splat.cli.common.console import note
    from diff4splat.cli.options.physical_path import choose_optics, to_photo_settings
    from diff4splat.io.movies.suffixes import is_movie
    from diff4splat.outputs.physical_view import require_view_suffix, write_physical_view

    suffix = require_view_suffix(out)
    physical_path, notes = choose_optics(scene, path, options)
    for line in notes:
        note(line)
    if suffix == ".png" and not is_movie(out):
        physical_path = select_physical_frame(physical_path, frame)
    settings = to_photo_settings(options)
    precompile_renderers(scene, [physical_path], settings, log.phases)
    taken = write_physical_view(scene, physical_path, out, settings, log)
    for line in taken.lines():
        note(line)
    if suffix == ".exr" and _is_wider_than_half_space(physical_path):
        note("the lens looks sideways or behind itself: distance along the ray, not z-depth")


def render_dataset(
    scene: "Scene",
    path: "CameraPath",
    options: OpticsOptions,
    out: Path,
    time_s: float | None,
    log: "RunLog",
) -> None:
    """Write each effect, and all effects combined, to folders in ``out``."""
    from diff4splat.cli.common.console import note
    from diff4splat.cli.options.physical_path import choose_effects, to_photo_settings
    from diff4splat.outputs.camera_dataset.writer import (
        DatasetJob,
        require_empty,
        write_camera_dataset,
    )
    from diff4splat.outputs.photo_sequence import freeze_time

    require_empty(out)
    sequences, notes = choose_effects(freeze_time(scene, time_s), path, options)
    for line in notes:
        note(line)
    settings = to_photo_settings(options)
    precompile_renderers(scene, sequences.values(), settings, log.phases)
    job = DatasetJob(scene=scene, sequences=sequences, settings=settings, time_s=time_s)
    taken = write_camera_dataset(job, out, log)
    for name, stats in taken.items():
        note(f"{name}: {'; '.join(stats.lines())}")


def precompile_renderers(
    scene: "Scene",
    sequences: "Iterable[PhysicalPath]",
    settings: "PhotoSettings",
    phases: "Phases",
) -> None:
    """Compile what will draw, with a progress bar, unless that is done."""
    from diff4splat.cli.common.precompile import precompile_renderer, precompile_tracer
    from diff4splat.outputs.photo_sequence import needs_rays

    traced = [needs_rays(scene, filmed, settings) for filmed in sequences]
    if any(traced):
        precompile_tracer(phases)
    if not all(traced):
        precompile_renderer(scene.gaussians, phases)


def _is_wider_than_half_space(physical_path: "PhysicalPath") -> bool:
    from diff4splat.outputs.photo_sequence import geometry_kind

    return geometry_kind(physical_path) == "distance"
