"""``diff4splat render``: any camera path and any time, from a scene file alone."""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.cli.camera_choice import CameraOptions, choose_path
from diff4splat.cli.guard_overwrite import require_inputs_kept
from diff4splat.cli.optics_options import OpticsOptions, require_consistent
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.progress.run_log import RunLog
    from diff4splat.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Render:
    """Look at a scene along any camera path, at any time."""

    scene: Annotated[Path, tyro.conf.Positional]
    """A scene file."""
    out: Path = Path("render.mp4")
    """A video (.mp4), one picture (.png) or depth (.exr); with --dataset a folder."""
    camera: str | None = None
    """Presets or a path file; if left out, the path that the scene suggests."""
    time: float | None = None
    """Stop the clock at this many seconds; if left out, time runs along the path."""
    frame: int = 0
    """Which pose of the path a single picture shows; -1 is the last."""
    resolution: int | None = None
    """Pixels on the longer side; if left out, as the scene suggests."""
    dataset: bool = False
    """Write a folder of matched sequences with exact cameras: a pinhole, a fisheye, depth of field,
    rolling shutter, motion blur, and all of these at once."""
    options: Annotated[CameraOptions, tyro.conf.arg(name="")] = field(default_factory=CameraOptions)
    optics: Annotated[OpticsOptions, tyro.conf.arg(name="")] = field(default_factory=OpticsOptions)

    def run(self) -> None:
        """Load, choose cameras and times, render, write."""
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.cli.precompile import precompile_renderer
        from diff4splat.cli.skipped_gaussians import skipped_gaussians
        from diff4splat.io.scene_file import load_scene
        from diff4splat.outputs.scene_folder import VIEW_SUFFIXES, write_view
        from diff4splat.progress.run_log import RunLog

        if self.time is not None and not math.isfinite(self.time):
            raise ConfigError(f"--time: expected seconds, got {self.time:g}")
        require_inputs_kept((self.scene, Path(self.camera or "")), (self.out,))
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
            self.film(scene, path, log)
            return
        if self.out.suffix.lower() == ".png":
            path = one_pose(path, self.frame)
        if self.out.suffix.lower() in VIEW_SUFFIXES:  # others are refused, and at once
            precompile_renderer(scene.gaussians, log.phases)
        time_s = float(path.times_s[0]) if self.time is None else self.time
        if skipped := skipped_gaussians(scene, time_s):
            note(skipped)
        write_view(scene, path, self.out, self.time, log)
        note(f"wrote {self.out} ({len(path)} frame{'s' if len(path) > 1 else ''})")

    def film(self, scene: "Scene", path: "CameraPath", log: "RunLog") -> None:
        """Through a physical camera."""
        from diff4splat.cli.console import note
        from diff4splat.cli.render_physical import film_dataset, film_file
        from diff4splat.outputs.photographs import stopped

        if self.dataset:
            film_dataset(scene, path, self.optics, self.out, self.time, log)
        else:
            film_file(stopped(scene, self.time), path, self.optics, self.out, self.frame, log)
        note(f"wrote {self.out}")

    def chosen_path(self, scene: "Scene") -> "CameraPath":
        """Cameras at the asked size, with the times at which the scene is shown."""
        from diff4splat.paths.picture_size import resized
        from diff4splat.paths.settings import PathFrame
        from diff4splat.scene.extent import depth_range

        own = scene.path
        if self.resolution is not None:
            own = resized(own, longer_side(own.cameras.size_px, self.resolution))
        if self.camera is None:
            return own
        depths = depth_range(scene)
        view = PathFrame(camera=own.cameras[0], near_depth=depths.near, focus_depth=depths.focus)
        return choose_path(self.camera, view, self.options)


def longer_side(size_px: tuple[int, int], pixels: int) -> tuple[int, int]:
    """(height, width) of the same shape with ``pixels`` on the longer side."""
    if not 1 <= pixels <= 8192:
        raise ConfigError(f"--resolution: expected 1 to 8192 pixels, got {pixels}")
    height, width = (max(1, round(side * pixels / max(size_px))) for side in size_px)
    return height, width


def one_pose(path: "CameraPath", frame: int) -> "CameraPath":
    """The path that consists of one of its poses."""
    if not -len(path) <= frame < len(path):
        raise ConfigError(f"--frame: expected -{len(path)} to {len(path) - 1}, got {frame}")
    index = slice(frame % len(path), frame % len(path) + 1)
    return replace(path, cameras=path.cameras[index], times_s=path.times_s[index])
