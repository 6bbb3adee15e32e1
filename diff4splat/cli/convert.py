"""``diff4splat convert``: a scene as INRIA PLY, at one time or as a numbered sequence."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.cli.options.guard_overwrite import require_inputs_kept
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.scene.scene import Scene


MAX_FILES = 10_000


@dataclass(frozen=True, kw_only=True)
class Convert:
    """Write a scene as PLY: one file at one time, or a numbered sequence into a folder."""

    scene: Annotated[Path, tyro.conf.Positional]
    """A scene file."""
    out: Path
    """A name ending in .ply for one time, or a folder for a sequence."""
    time: float | None = None
    """Time in seconds of a single file. Default: the start of the motion."""
    fps: float = 24.0
    """Files per second of a sequence."""

    def run(self) -> None:
        """Read, convert, write; existing files are replaced only by whole ones."""
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.io.ply import write_ply, write_ply_sequence
        from diff4splat.io.scene_file import load_scene
        from diff4splat.scene.scene import DILATION_PX2

        require_inputs_kept((self.scene,), (self.out,))
        scene = load_scene(self.scene)
        if scene.dilation_px2 < DILATION_PX2:
            note(
                f"made for a dilation of {scene.dilation_px2:g} px², which a PLY cannot say: "
                f"viewers add {DILATION_PX2:g} and show it softer"
            )
        start_s, _ = scene.motion.time_range_s
        if self.out.suffix.lower() == ".ply":
            time_s = start_s if self.time is None else self.time
            if not math.isfinite(time_s):
                raise ConfigError(f"--time: expected seconds, got {time_s:g}")
            write_ply(scene.state_at(time_s), self.out, comments=(f"time_s {time_s:g}",))
            note(f"wrote {self.out} ({len(scene.gaussians):,} Gaussians at {time_s:g} s)")
            return
        if self.time is not None:
            raise ConfigError(
                "--time: expected together with one .ply file; --out is a folder here"
            )
        if not 0 < self.fps < 1e4:
            raise ConfigError(f"--fps: expected a number above 0, got {self.fps:g}")
        times_s = file_times_s(scene, self.fps)
        count = len(times_s)
        with ConsolePhases().phase("write PLY", count) as advance:
            write_ply_sequence(scene, self.out, times_s, advance=advance)
        note(f"wrote {count} files to {self.out}")


def file_times_s(scene: "Scene", fps: float) -> list[float]:
    """Time of each file of a sequence; one file for a static scene."""
    start_s, stop_s = scene.motion.time_range_s
    if len(scene.motion.moving_index) == 0:
        return [start_s]
    # Times are stored in float32, so the last one may lie a rounding error too early.
    count = math.floor((stop_s - start_s) * fps + 1e-4) + 1
    if count > MAX_FILES:
        raise ConfigError(f"--fps: expected at most {MAX_FILES:,} files, got {count:,}; lower it")
    return [start_s + index / fps for index in range(count)]
