"""``diff4splat render``: images and videos of a scene file, for any camera path and time."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.limits.options import LimitOptions
from diff4splat.cli.options.camera import (
    CameraOptions,
    choose_path,
    require_camera,
    require_no_preset_options,
    scene_path,
)
from diff4splat.cli.options.constraints import InputPath, Number, OutputFile, require_writable
from diff4splat.cli.options.device import render_device
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.cli.options.optics import OpticsOptions, require_consistent
from diff4splat.cli.options.scene_time import require_scene_time
from diff4splat.cli.options.single_frame import select_frame
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.paths.camera_path import CameraPath
    from diff4splat.progress.run_log import RunLog
    from diff4splat.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Render:
    """Render a scene along any camera path, at any time."""

    scene: Annotated[Path, tyro.conf.Positional, InputPath(what="a scene or checkpoint")]
    """A scene file, or whatever `diff4splat convert` reads."""
    out: Annotated[Path, tyro.conf.arg(aliases=("-o",))] = Path("render.mp4")
    """A video (.mp4, .webm, .gif, .webp), images (%04d.png), one image (.png) or depth (.exr,
    %04d.exr); with --dataset, a folder."""
    camera: str | None = None
    """Camera presets or a path file. Default: the path in the scene file."""
    time: Annotated[float | None, Number()] = None
    """Render all frames at this time of the scene in seconds. Default: the times of the path."""
    frame: int = 0
    """Frame of the path for a single image; -1 is the last."""
    resolution: Annotated[int | None, Number(least=1, most=8192)] = None
    """Longer image side in pixels. Default: as in the scene file."""
    dataset: bool = False
    """Write a folder of sequences along the same path with exact cameras: pinhole, fisheye, depth
    of field, rolling shutter, motion blur, and all effects combined."""
    device: str = "cpu"
    """Where frames are rendered: cpu, cuda (by gsplat), or auto, which is cuda where there is one.
    Optics are traced on the CPU."""
    dtype: Literal["float32", "float64"] = "float32"
    """float64: frames of the exact reference renderer, which is many times as slow."""
    options: Annotated[CameraOptions, tyro.conf.arg(name="")] = field(default_factory=CameraOptions)
    optics: Annotated[OpticsOptions, tyro.conf.arg(name="")] = field(default_factory=OpticsOptions)
    limits: Annotated[LimitOptions, tyro.conf.arg(name="")] = field(default_factory=LimitOptions)

    def check(self) -> None:
        """Check which options are given together."""
        from diff4splat.outputs.file_names import VIEW_SUFFIXES

        require_inputs_not_overwritten((self.scene, Path(self.camera or "")), (self.out,))
        if self.limits.limits.given and (self.dataset or self.optics != OpticsOptions()):
            raise ConfigError(
                "--tolerance, --budget: expected a pinhole camera, got optics or --dataset; set "
                "--tolerance-px, --aperture-samples and so on instead"
            )
        special = self.dataset or self.optics != OpticsOptions() or self.limits.limits.given
        if self.dtype != "float32" and (special or self.device != "cpu"):
            raise ConfigError(
                f"--dtype {self.dtype}: expected a pinhole camera on the CPU without --tolerance "
                "or --budget; leave out --dtype"
            )
        if self.camera is not None:
            require_camera(self.camera, self.options)
        else:
            require_no_preset_options(self.options)
        if not self.dataset:
            OutputFile(suffixes=VIEW_SUFFIXES).check("--out", self.out)
            require_consistent(self.optics)
            return
        if self.frame:
            raise ConfigError("--frame: expected without --dataset, which has all frames")
        if self.out.suffix.lower() in VIEW_SUFFIXES:
            raise ConfigError(f"--dataset: expected a folder as --out, got {self.out}; name one")
        require_writable(self.out, is_folder=True)

    def run(self) -> None:
        """Load, choose cameras and times, render, write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.cli.common.skipped_gaussians import skipped_gaussians
        from diff4splat.cli.limits.rendering import apply, measured_loss_db, promise
        from diff4splat.cli.limits.stopwatch import Stopwatch
        from diff4splat.io.checkpoints.import_scene import import_scene
        from diff4splat.io.movies.suffixes import is_movie
        from diff4splat.outputs.run_estimate import estimate_frames, require_fits
        from diff4splat.outputs.scene_folder import write_view
        from diff4splat.progress.run_log import RunLog

        promised, watch = promise(self), Stopwatch.of_process()
        device = render_device(self.device)
        # Costs are those of the rasteriser; the reference has no forecast.
        has_forecast = self.dtype == "float32"
        for line in promised.lines() if has_forecast else ():
            note(line)
        imported = import_scene(self.scene)
        scene = in_dtype(imported.scene, self.dtype)
        for line in imported.notes:
            note(line)
        require_scene_time(scene, self.time)
        path = self.chosen_path(scene)
        log = RunLog(phases=ConsolePhases())
        if self.dataset or self.optics != OpticsOptions():
            self.render_physical(scene, path, log)
            return
        if self.out.suffix.lower() == ".png" and not is_movie(self.out):
            path = select_frame(path, self.frame)
        full = path
        path, settings = apply(promised, path)
        precompile_renderer(scene.gaussians, log.phases)
        time_s = float(path.times_s[0]) if self.time is None else self.time
        if skipped := skipped_gaussians(scene, time_s):
            note(skipped)
        suffix, size_px = self.out.suffix.lower(), path.cameras.size_px
        needed = estimate_frames(len(path), size_px, suffix == ".exr", suffix == ".gif")
        if line := require_fits(needed, self.out.parent, "choose fewer --frames"):
            note(line)
        for line in write_view(scene, path, self.out, self.time, log, settings, device):
            note(line)
        measured = watch.read()
        if promised.limits.tolerance_db is not None:
            measured["loss_db"] = measured_loss_db(scene, (full, path), settings)
        for line in promised.after(measured) if has_forecast else ():
            note(line)
        note(f"wrote {self.out} ({len(path)} frame{'s' if len(path) > 1 else ''})")

    def render_physical(self, scene: "Scene", path: "CameraPath", log: "RunLog") -> None:
        """Render with a physical camera."""
        from diff4splat.cli.common.console import note
        from diff4splat.cli.scenes.render_physical import render_dataset, render_file
        from diff4splat.outputs.photo_sequence import freeze_time

        if self.dataset:
            render_dataset(scene, path, self.optics, self.out, self.time, log)
        else:
            render_file(freeze_time(scene, self.time), path, self.optics, self.out, self.frame, log)
        note(f"wrote {self.out}")

    def chosen_path(self, scene: "Scene") -> "CameraPath":
        """Cameras at the requested size, with their times."""
        from diff4splat.paths.resize import resized
        from diff4splat.scene.extent import scene_frame

        path = scene.path
        if self.resolution is not None:
            path = resized(path, longer_side(path.cameras.size_px, self.resolution))
        if self.camera is None:
            return scene_path(path, self.options)
        return choose_path(self.camera, scene_frame(scene, path.cameras[0]), self.options)


def in_dtype(scene: "Scene", dtype: str) -> "Scene":
    """The scene as it is, or in double precision, which only the reference renders."""
    import torch

    return scene if dtype == "float32" else scene.to(torch.float64)


def longer_side(size_px: tuple[int, int], pixels: int) -> tuple[int, int]:
    """(height, width) of the same aspect ratio with ``pixels`` on the longer side."""
    height, width = (max(1, round(side * pixels / max(size_px))) for side in size_px)
    return height, width
