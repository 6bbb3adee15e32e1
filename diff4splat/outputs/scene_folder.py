"""A generated scene as people want it: scene file, video, depth, contact sheet and card.

Axes: ``t`` frames, ``h w`` pixels. Files: scene.safetensors, video.mp4, depth.exr, preview.png,
card.json. They are written into a folder that the caller stages, so that they appear together.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.io.exr import write_depth_exr
from diff4splat.io.figures.contact_sheet import SheetContent, contact_sheet
from diff4splat.io.photos.images import write_png
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.io.video import write_video
from diff4splat.outputs.card import Result
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.phases import Phases
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render_video
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

UNTRAINED = "untrained: random weights; this is the photograph itself, standing in space"
SheetFacts = tuple[tuple[str, str], ...]
"""(name, value) pairs printed beside the photograph."""
OUTPUT_FILES = ("scene.safetensors", "video.mp4", "depth.exr", "preview.png", "card.json")
VIDEO_FPS = (0.5, 240.0)
VIEW_SUFFIXES = (".mp4", ".png", ".exr")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """What the path shows."""

    rgb: Float[Tensor, "t h w 3"]
    depth: Float[Tensor, "t h w"] | None
    """Expected depth, 0 where nothing is seen; None when it was not asked for."""


def render_frames(scene: Scene, path: CameraPath, log: RunLog, with_depth: bool = True) -> Frames:
    """Every frame of ``path``; depth is blended only when asked for."""
    outputs = ("rgb", "depth") if with_depth else ("rgb",)
    with log.phases.phase("render", len(path)) as advance, torch.no_grad():
        frames = list(render_video(scene, path, outputs=outputs, advance=advance))
    if isinstance(scene.motion, StaticMotion):
        log.record_skipped("states per frame", "nothing moves", f"{len(path) - 1} scene states")
    rgb = torch.stack([frame.rgb for frame in frames]).clamp(0, 1)
    if with_depth:
        return Frames(rgb=rgb, depth=torch.stack([frame.depth for frame in frames]))
    log.record_skipped("depth", "not asked for", f"{len(path)} blended depth maps")
    return Frames(rgb=rgb, depth=None)


def write_scene_folder(
    folder: Path, result: Result, frames: Frames, facts: SheetFacts, phases: Phases
) -> None:
    """Write everything but the card, which comes last because it knows how long the rest took.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    scene = result.scene
    _write_video(frames, scene.path, folder / "video.mp4", phases)
    with phases.phase("write files", 3) as advance:
        save_scene(scene, folder / "scene.safetensors")
        advance()
        if frames.depth is not None:
            write_depth_exr(frames.depth, scene.path, folder / "depth.exr")
        advance()
        write_png(preview(result, frames, facts), folder / "preview.png")
        advance()


def preview(result: Result, frames: Frames, facts: SheetFacts) -> Float[Tensor, "h w 3"]:
    """The contact sheet."""
    return contact_sheet(
        SheetContent(
            photo=result.photo,
            frames=frames.rgb,
            depth=frames.depth,
            times_s=result.scene.path.times_s,
            facts=facts,
            note=UNTRAINED if result.scene.provenance.untrained else None,
        )
    )


def write_view(
    scene: Scene, path: CameraPath, file: Path, time_s: float | None, log: RunLog
) -> None:
    """Render ``path`` into one file whose suffix says what it holds: .mp4, .png or .exr.

    With ``time_s`` the clock stands still there.

    Raises:
        ConfigError: another suffix.
        OutputError: the file cannot be written.
    """
    suffix = file.suffix.lower()
    if suffix not in VIEW_SUFFIXES:
        raise ConfigError(
            f"--out: expected a name ending in {', '.join(VIEW_SUFFIXES)}, got {file}"
        )
    if time_s is not None:
        scene = replace(scene, gaussians=scene.state_at(time_s), motion=StaticMotion())
    wanted = ("depth",) if suffix == ".exr" else ("rgb",)
    with log.phases.phase("render", len(path)) as advance, torch.no_grad():
        frames = render_video(scene, path, outputs=wanted, advance=advance)
        if suffix == ".mp4":
            # Frame by frame: memory holds one, however long the path is.
            write_video((frame.rgb for frame in frames), file, frames_per_second(path))
        elif suffix == ".png":
            write_png(next(frames).rgb, file)
        else:
            depth = torch.stack([frame.depth for frame in frames])
            write_depth_exr(depth, path, file)


def _write_video(frames: Frames, path: CameraPath, file: Path, phases: Phases) -> None:
    with phases.phase("write video", len(path)) as advance:
        write_video(frames.rgb, file, frames_per_second(path), advance)


def frames_per_second(path: CameraPath) -> float:
    """The mean rate of a path, as far as videos can hold it; 24 for a single frame."""
    duration_s = float(path.times_s[-1] - path.times_s[0])
    low, high = VIDEO_FPS
    return min(max((len(path) - 1) / duration_s, low), high) if duration_s > 0 else 24.0
