"""What ``generate`` writes beside the card: video, scene file, depth, contact sheet."""

from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.common.console import note
from diff4splat.cli.common.precompile import precompile_renderer
from diff4splat.cli.common.skipped_gaussians import skipped_gaussians
from diff4splat.cli.options.device import render_device
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.io.movies.background_movie import BackgroundMovie
from diff4splat.io.movies.movie import default_suffix
from diff4splat.outputs.card import Result, describe
from diff4splat.outputs.compressed_scene import SceneFileFacts
from diff4splat.outputs.filming import FilmRecord, empty_note
from diff4splat.outputs.scene_folder import (
    frames_per_second,
    render_into,
    write_first_ply,
    write_scene_folder,
)
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.scene import Scene

if TYPE_CHECKING:
    from diff4splat.cli.generate import Generate


def write_results(
    command: "Generate", folder: Path, scene: Scene, input_image: InputImage, log: RunLog
) -> tuple[Result, SceneFileFacts, list[str]]:
    """Render the scene and write every file but the card; returns lines about the result."""
    precompile_renderer(scene.gaussians, log.phases)
    if skipped := skipped_gaussians(scene, float(scene.path.times_s[0])):
        note(skipped)
    device = render_device(command.device)
    record = FilmRecord(path=scene.path, with_depth=not command.skip_depth, device=device)
    with BackgroundMovie(folder / video_name(command), frames_per_second(scene.path)) as movie:
        render_into(movie, scene, record, log)
        result = Result.of(scene, input_image.rgb, record.first_rgb)
        facts = describe(result, command.camera, input_image.focal_source)
        scene_file = write_scene_folder(
            folder, result, record, facts, log.phases, command.compression
        )
        if command.ply:
            write_first_ply(scene, folder)
        with log.phases.phase("write video"):
            notes = movie.finish()
    lines = [*notes, *(f"{name}: {value}" for name, value in facts)]
    lines += [f"Scene file: {scene_file}", empty_note(scene, record)]
    return result, scene_file, [line for line in lines if line]


def video_name(command: "Generate") -> str:
    """The name of the video, which says its format."""
    return f"video.{command.video}" if command.video else f"video{default_suffix()}"
