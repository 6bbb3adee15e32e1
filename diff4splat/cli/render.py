"""``diff4splat render``: images and videos of a scene file, for any camera path and time."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.cli.options.camera import CameraOptions, choose_path
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.cli.options.optics import OpticsOptions, require_consistent
from diff4splat.cli.options.single_frame import select_frame
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.progress.run_log import RunLog
    from diff4splat.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Render:
    """Render a scene along any camera path, at any time."""

    scene: Annotated[Path, tyro.conf.Positional]
    """A scene file."""
    out: Path = Path("render.mp4")
    """A video (.mp4), one image (.png) or depth (.exr); with --dataset, a folder."""
    camera: str | None = None
    """Camera presets or a path file. Default: the path in the scene file."""
    time: float | None = None
    """Render all frames at this time in seconds. Default: the times of the path."""
    frame: int = 0
    """Frame of the path for a single image; -1 is the last."""
    resolution: int | None = None
    """Longer image side in pixels. Default: as in the scene file."""
    dataset: bool = False
    """Write a folder of sequences along the same path with exact cameras: pinhole, fisheye, depth
    of field, rolling shutter, motion blur, and all effects combined."""
    options: Annotated[CameraOptions, tyro.conf.arg(name="")] = field(default_factory=CameraOptions)
    optics: Annotated[OpticsOptions, tyro.conf.arg(name="")] = field(default_factory=OpticsOptions)

    def run(self) -> None:
        """Load, choose cameras and times, render, write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.cli.common.skipped_gaussians import skipped_gaussians
        from diff4splat.io.scene_files.scene_file import load_scene
        from diff4splat.outputs.scene_folder import VIEW_SUFFIXES, write_view
        from diff4splat.progress.run_log import RunLog

        if self.time is not None and not math.isfinite(self.time):
            raise ConfigError(f"--time: expected seconds, got {self.time:g}")
        require_inputs_not_overwritten((self.scene, Path(self.camera or "")), (self.out,))
        if self.camera is None and self.options != CameraOptions():
            raise ConfigError("--frames, --fps, --amplitude, --easing: expected with --camera only")
        if self.dataset and self.frame:
            raise ConfigError("--frame: expected without --dataset, which has all frames")
        if self.dataset and self.out.suffix.lower() in VIEW_SUFFIXES:
            raise ConfigError(f"--dataset: expected a folder as --out, got {self.out}; name one")
        if not self.dataset:
            require_consistent(self.optics)
        scene = load_scene(self.scene)
        path = self.chosen_path(scene)
        log = RunLog(phases=ConsolePhases())
        if self.dataset or self.optics != OpticsOptions():
            self.render_physical(scene, path, log)
            return
        if self.out.suffix.lower() == ".png":
            path = select_frame(path, self.frame)
        if self.out.suffix.lower() in VIEW_SUFFIXES:  # others are refused, and at once
            precompile_renderer(scene.gaussians, log.phases)
        time_s = float(path.times_s[0]) if self.time is None else self.time
        if skipped := skipped_gaussians(scene, time_s):
            note(skipped)
        write_view(scene, path, self.out, self.time, log)
        note(f"wrote {self.out} ({len(path)} frame{'s' if len(path) > 1 else ''})")

    def render_physical(self, scene: "Scene", path: "CameraPath", log: "RunLog") -> None:
        """Render with a physical camera."""
        from diff4splat.cli.common.console import note
        from diff4splat.cli.render_physical import render_dataset, render_file
        from diff4splat.outputs.photo_sequence import freeze_time

        if self.dataset:
            render_dataset(scene, path, self.optics, self.out, self.time, log)
        else:
            render_file(freeze_time(scene, self.time), path, self.optics, self.out, self.frame, log)
        note(f"wrote {self.out}")

    def chosen_path(self, scene: "Scene") -> "CameraPath":
        """Cameras at the requested size, with their times."""
        from diff4splat.paths.resize import resized
        from diff4splat.paths.settings import PathFrame
        from diff4splat.scene.extent import depth_range

        path = scene.path
        if self.resolution is not None:
            path = resized(path, longer_side(path.cameras.size_px, self.resolution))
        if self.camera is None:
            return path
        depths = depth_range(scene)
        view = PathFrame(camera=path.cameras[0], near_depth=depths.near, focus_depth=depths.focus)
        return choose_path(self.camera, view, self.options)


def longer_side(size_px: tuple[int, int], pixels: int) -> tuple[int, int]:
    """(height, width) of the same aspect ratio with ``pixels`` on the longer side."""
    if not 1 <= pixels <= 8192:
        raise ConfigError(f"--resolution: expected 1 to 8192 pixels, got {pixels}")
    height, width = (max(1, round(side * pixels / max(size_px))) for side in size_px)
    return height, width
