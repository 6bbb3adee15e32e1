"""A generated scene as people want it: scene file, video, depth, contact sheet and card.

Axes: ``t`` frames, ``h w`` pixels. Files: scene.safetensors, scene.html, video.mp4 (or .webm, .gif,
.webp), depth.exr, preview.png, card.json. They are written into a folder that the caller stages, so
that they appear together.
"""

from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.io.atomic import atomic_folder
from diff4splat.io.exr import write_depth_exr
from diff4splat.io.figures.contact_sheet import SheetContent, contact_sheet
from diff4splat.io.movies.animations import require_numbered
from diff4splat.io.movies.background_movie import BackgroundMovie
from diff4splat.io.movies.suffixes import is_movie
from diff4splat.io.photos.images import write_png
from diff4splat.io.ply.ply_file import write_ply
from diff4splat.io.scene_files.compression import Compression
from diff4splat.outputs.card import Result
from diff4splat.outputs.compressed_scene import SceneFileFacts, write_scene
from diff4splat.outputs.file_names import VIEW_SUFFIXES
from diff4splat.outputs.filming import FilmRecord, empty_note, film, on_device
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.phases import Phases
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import DEFAULTS, render_video
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene
from diff4splat.viewer.page import write_page_or_reason

UNTRAINED = "untrained: random weights; this is the photograph itself, on a plane"
SheetFacts = tuple[tuple[str, str], ...]
"""(name, value) pairs printed beside the photograph."""
VIDEO_FPS = (0.5, 240.0)


def write_film(scene: Scene, file: Path, record: FilmRecord, log: RunLog) -> tuple[str, ...]:
    """The video along the record's path, encoded while it is rendered; returns notes on its format.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    with BackgroundMovie(file, frames_per_second(record.path)) as movie:
        render_into(movie, scene, record, log)
        return movie.finish()


def render_into(movie: BackgroundMovie, scene: Scene, record: FilmRecord, log: RunLog) -> None:
    """Every frame of the record's path."""
    for rgb in film(scene, record, log):
        movie.add(rgb)


def write_scene_folder(
    folder: Path,
    result: Result,
    record: FilmRecord,
    facts: SheetFacts,
    phases: Phases,
    compression: Compression = "standard",
) -> SceneFileFacts:
    """Write what stands beside the video, but the card, which knows how long the rest took.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    scene = result.scene
    with phases.phase("write files", 4) as advance:
        scene_file = write_scene(scene, folder / "scene.safetensors", compression)
        advance()
        write_page_or_reason(scene, folder / "scene.html")
        advance()
        if record.depth is not None:
            write_depth_exr(record.depth, scene.path, folder / "depth.exr")
        advance()
        write_png(preview(result, record, facts), folder / "preview.png")
        advance()
    return scene_file


def write_first_ply(scene: Scene, folder: Path) -> None:
    """The scene at its first time as ``scene.ply``.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    time_s, _ = scene.motion.time_range_s
    write_ply(scene.state_at(time_s), folder / "scene.ply", comments=(f"time_s {time_s:g}",))


def preview(result: Result, record: FilmRecord, facts: SheetFacts) -> Float[Tensor, "h w 3"]:
    """The contact sheet."""
    index = record.sheet_index
    return contact_sheet(
        SheetContent(
            photo=result.photo,
            frames=torch.stack(record.sheet_rgb),
            depth=None if record.depth is None else record.depth[index],
            times_s=record.path.times_s[index],
            facts=facts,
            note=UNTRAINED if result.scene.provenance.untrained else None,
        )
    )


def write_view(
    scene: Scene,
    path: CameraPath,
    file: Path,
    time_s: float | None,
    log: RunLog,
    settings: RenderSettings = DEFAULTS,
    device: str = "cpu",
) -> tuple[str, ...]:
    """Render ``path`` into one file whose name says what it holds; returns notes about it.

    With ``time_s`` all frames show that time. Frames are rendered on ``device``.

    Raises:
        ConfigError: another suffix.
        OutputError: the file cannot be written.
    """
    require_view_suffix(file)
    if time_s is not None:
        scene = replace(scene, gaussians=scene.state_at(time_s), motion=StaticMotion())
    if file.suffix.lower() == ".exr":
        with log.phases.phase("render", len(path)) as advance, torch.no_grad():
            there = on_device(scene, device)
            frames = render_video(
                there, path, outputs=("depth",), settings=settings, advance=advance
            )
            _write_depth(torch.stack([frame.depth.cpu() for frame in frames]), path, file)
        return ()
    record = FilmRecord(path=path, with_depth=False, settings=settings, device=device)
    notes: tuple[str, ...] = ()
    if is_movie(file):
        notes = write_film(scene, file, record, log)
    else:
        write_png(next(film(scene, record, log)), file)
    empty = empty_note(scene, record)
    return notes if empty is None else (*notes, empty)


def _write_depth(depth: Float[Tensor, "t h w"], path: CameraPath, file: Path) -> None:
    """One file of all frames, or a file per frame where the name has a number."""
    if "%" not in file.name:
        write_depth_exr(depth, path, file)
        return
    require_numbered(file)
    with atomic_folder(file.parent) as staging:
        for number in range(len(path)):
            frame = slice(number, number + 1)
            single = replace(path, cameras=path.cameras[frame], times_s=path.times_s[frame])
            write_depth_exr(depth[frame], single, staging / (file.name % number))


def require_view_suffix(file: Path) -> str:
    """The suffix of ``file`` when something can be written under it.

    Raises:
        ConfigError: it is another.
    """
    suffix = file.suffix.lower()
    if suffix not in VIEW_SUFFIXES:
        raise ConfigError(
            f"--out: expected a name ending in {', '.join(VIEW_SUFFIXES)}, got {file}"
        )
    return suffix


def frames_per_second(path: CameraPath) -> float:
    """The mean rate of a path, as far as videos can hold it; 24 for a single frame."""
    duration_s = float(path.times_s[-1] - path.times_s[0])
    low, high = VIDEO_FPS
    return min(max((len(path) - 1) / duration_s, low), high) if duration_s > 0 else 24.0
