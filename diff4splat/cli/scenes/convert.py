"""``diff4splat convert``: scenes and files of other programs as PLY, SPZ, GLB or a scene file."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, require_writable
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.cli.options.scene_time import require_scene_time
from diff4splat.errors import ConfigError
from diff4splat.io.splats.suffixes import SPLAT_SUFFIXES

if TYPE_CHECKING:
    from diff4splat.scene.scene import Scene


MAX_FILES = 10_000
SCENE_SUFFIX = ".safetensors"
FILE_SUFFIXES = (*SPLAT_SUFFIXES, SCENE_SUFFIX)


@dataclass(frozen=True, kw_only=True)
class Convert:
    """Convert a scene, or a file of another program, to PLY, SPZ, GLB or to a scene file."""

    scene: Annotated[Path, tyro.conf.Positional, InputPath(what="a scene or checkpoint")]
    """A scene file, a .ply, .spz or .glb file of Gaussians, a 4DGaussians model folder, or a
    checkpoint (.pth) of native 4D Gaussians."""
    out: Annotated[Path, tyro.conf.arg(aliases=("-o",))]
    """A .ply, .spz or .glb file for one time, a .safetensors scene file, or a folder for a PLY
    sequence."""
    time: Annotated[float | None, Number()] = None
    """Time in seconds of a single file. Default: the start of the motion."""
    fps: Annotated[float, Number(above=0, most=9999)] = 24.0
    """Files per second of a sequence."""
    time_range: Annotated[tuple[float, float] | None, Number()] = None
    """Start and stop of a checkpoint's motion in seconds. Default: 0 1 for 4DGaussians, -0.5 0.5
    for native 4D Gaussians."""

    def check(self) -> None:
        """Check what depends on the kind of output."""
        suffix = output_suffix(self.out)
        require_inputs_not_overwritten((self.scene,), (self.out,))
        require_writable(self.out, is_folder=suffix not in FILE_SUFFIXES)
        if self.time is not None and suffix not in SPLAT_SUFFIXES:
            kind = "a scene file" if suffix == SCENE_SUFFIX else "a folder"
            raise ConfigError(
                f"--time: expected together with one .ply, .spz or .glb file; --out is {kind} here"
            )

    def run(self) -> None:
        """Read, convert, write; existing files are replaced only by complete ones."""
        from diff4splat.cli.common.console import note
        from diff4splat.io.checkpoints.import_scene import import_scene

        suffix = output_suffix(self.out)
        imported = import_scene(self.scene, self.time_range)
        for line in imported.notes:
            note(line)
        if suffix == SCENE_SUFFIX:
            self._write_scene(imported.scene)
        elif suffix in SPLAT_SUFFIXES:
            self._write_moment(imported.scene)
        else:
            self._write_sequence(imported.scene)

    def _write_scene(self, scene: "Scene") -> None:
        from diff4splat.cli.common.console import note
        from diff4splat.io.scene_files.scene_file import save_scene

        save_scene(scene, self.out)
        note(f"wrote {self.out} ({len(scene.gaussians):,} Gaussians)")

    def _write_moment(self, scene: "Scene") -> None:
        from diff4splat.cli.common.console import note
        from diff4splat.outputs.splat_export import export_moment

        _note_dilation(scene)
        start_s, _ = scene.motion.time_range_s
        time_s = start_s if self.time is None else self.time
        require_scene_time(scene, time_s)
        measured = export_moment(scene, time_s, self.out)
        if len(scene.motion.moving_index):
            note(f"{self.out.suffix} holds one moment: motion is left out")
        note(f"wrote {self.out} ({len(scene.gaussians):,} Gaussians at {time_s:g} s)")
        note(f"read again and rendered: {measured:.1f} dB to the scene in the worst of its views")

    def _write_sequence(self, scene: "Scene") -> None:
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.io.ply.ply_file import write_ply_sequence

        _note_dilation(scene)
        times_s = file_times_s(scene, self.fps)
        with ConsolePhases().phase("write PLY", len(times_s)) as advance:
            write_ply_sequence(scene, self.out, times_s, advance=advance)
        note(f"wrote {len(times_s)} files to {self.out}")


def output_suffix(out: Path) -> str:
    """The suffix of one file, or nothing for a folder.

    Raises:
        ConfigError: a suffix of no format that is written, and no folder of that name.
    """
    suffix = out.suffix.lower()
    if suffix in FILE_SUFFIXES or not suffix:
        return suffix
    if out.is_dir():
        return ""
    raise ConfigError(
        f"--out: expected a name ending in {', '.join(FILE_SUFFIXES)}, or a folder without a "
        f"suffix, got {out}; rename it, or make the folder first"
    )


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


def _note_dilation(scene: "Scene") -> None:
    from diff4splat.cli.common.console import note
    from diff4splat.scene.scene import DILATION_PX2

    if scene.dilation_px2 < DILATION_PX2:
        note(
            f"made for a dilation of {scene.dilation_px2:g} px², which the file cannot say: "
            f"viewers add {DILATION_PX2:g} and show it softer"
        )
