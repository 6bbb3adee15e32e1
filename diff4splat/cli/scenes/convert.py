"""``diff4splat convert``: scenes and files of other programs into each other, by their endings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, require_writable
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.cli.options.scene_time import require_scene_time
from diff4splat.cli.scenes.export_html import PAGE_SUFFIXES
from diff4splat.errors import ConfigError
from diff4splat.io.splats.suffixes import (
    MOVING_SUFFIXES,
    ONNX_SUFFIX,
    SPLAT_SUFFIXES,
    USD_SUFFIXES,
)
from diff4splat.outputs.file_names import VIEW_SUFFIXES

if TYPE_CHECKING:
    from diff4splat.outputs.export_check import ExportCheck
    from diff4splat.scene.scene import Scene


MAX_FILES = 10_000
FILE_SUFFIXES = (*SPLAT_SUFFIXES, *MOVING_SUFFIXES, *PAGE_SUFFIXES, *VIEW_SUFFIXES)


@dataclass(frozen=True, kw_only=True)
class Convert:
    """Convert a scene, or a file of another program, to the format that the output's ending names.

    The result is read again, rendered and compared with the scene before it appears.
    """

    scene: Annotated[Path, tyro.conf.Positional, InputPath(what="a scene or checkpoint")]
    """A scene file; .ply (INRIA, SHARP, SuperSplat, Spacetime Gaussians and others), .spz or .glb;
    a folder of numbered .ply files or of a 4DGaussians model; a checkpoint (.pth) of native 4D
    Gaussians; point maps (.npz)."""
    target: Annotated[Path | None, tyro.conf.Positional] = None
    """The output, as for --out."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=("-o",))] = None
    """One time: .ply, .spz, .glb. All times: .safetensors, .usdc, .usda, .onnx, .html, or a folder
    for a PLY sequence. Images of the scene's path: .mp4, .webm, .gif, .webp, .png, .exr."""
    time: Annotated[float | None, Number()] = None
    """Time in seconds of a single file. Default: the start of the motion."""
    fps: Annotated[float, Number(above=0, most=9999)] = 24.0
    """Files per second of a sequence, read or written."""
    time_range: Annotated[tuple[float, float] | None, Number()] = None
    """Start and stop of a checkpoint's motion in seconds. Default: 0 1 for 4DGaussians, -0.5 0.5
    for native 4D Gaussians."""
    bake: bool = False
    """Make any motion key frames, which all viewers play; prints their error in pixels."""
    compression: Literal["lossless", "standard", "small"] = "lossless"
    """Of a scene file: without loss, without visible loss, or smallest."""
    spz_version: Literal[3, 4] = 3
    """Version of .spz; 4 needs zstandard."""

    @property
    def file(self) -> Path:
        """The output."""
        return self.out or self.target or Path()

    def check(self) -> None:
        """Check what depends on the kind of output."""
        if (self.out is None) == (self.target is None):
            raise ConfigError("convert: expected one output, as a second name or with --out")
        suffix = output_suffix(self.file)
        require_inputs_not_overwritten((self.scene,), (self.file,))
        if "%" not in self.file.name:
            require_writable(self.file, is_folder=suffix not in FILE_SUFFIXES)
        if self.time is not None and suffix not in (*SPLAT_SUFFIXES, *VIEW_SUFFIXES):
            kind = "all times" if suffix else "a folder"
            raise ConfigError(
                f"--time: expected together with one .ply, .spz or .glb file; --out is {kind} here"
            )

    def run(self) -> None:
        """Read, convert, compare, write; existing files are replaced only by complete ones."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.io.checkpoints.import_scene import import_scene
        from diff4splat.outputs.moving_export import baked

        suffix = output_suffix(self.file)
        if suffix in VIEW_SUFFIXES:
            self._render()
            return
        with ConsolePhases().phase("read"):
            imported = import_scene(self.scene, self.time_range, self.fps)
        scene, lost = imported.scene, imported.notes
        if self.bake and len(scene.motion.moving_index):
            scene, more = baked(scene)
            lost = (*lost, *more)
        for line in lost:
            note(line)
        if suffix in PAGE_SUFFIXES:
            self._write_page(scene)
        elif suffix in MOVING_SUFFIXES:
            self._write_moving(scene, suffix, lost)
        elif suffix in SPLAT_SUFFIXES:
            self._write_moment(scene, lost)
        else:
            self._write_sequence(scene, lost)

    def _render(self) -> None:
        from diff4splat.cli.scenes.render import Render

        command = Render(scene=self.scene, out=self.file, time=self.time)
        command.check()
        command.run()

    def _write_page(self, scene: "Scene") -> None:
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.viewer.page import write_page

        with ConsolePhases().phase("write page"):
            written = write_page(scene, self.file)
        for line in written.notes:
            note(line)
        note(f"wrote {self.file} ({self.file.stat().st_size / 1e6:.1f} MB)")

    def _write_moving(self, scene: "Scene", suffix: str, lost: tuple[str, ...]) -> None:
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.outputs import moving_export

        change = moving_export.keyed if suffix == ONNX_SUFFIX else moving_export.storable
        scene, more = (scene, ()) if suffix in USD_SUFFIXES else change(scene)
        for line in more:
            note(line)
        detail = f"{len(scene.gaussians):,} Gaussians"
        with ConsolePhases().phase("write and compare"):
            if suffix in USD_SUFFIXES:
                checks, times = moving_export.export_usd(scene, self.file)
                detail += f" at {times} times"
            elif suffix == ONNX_SUFFIX:
                checks, error = moving_export.export_onnx(scene, self.file)
                detail += f", numbers at most {error:.1e} off"
            else:
                checks = moving_export.export_scene_file(scene, self.file, self.compression)
        note(f"wrote {self.file} ({detail})")
        self._report(checks, (*lost, *more))

    def _write_moment(self, scene: "Scene", lost: tuple[str, ...]) -> None:
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.outputs.splat_export import export_moment

        start_s, _ = scene.motion.time_range_s
        time_s = start_s if self.time is None else self.time
        require_scene_time(scene, time_s)
        more = _dilation_notes(scene)
        if len(scene.motion.moving_index):
            more = (*more, f"{self.file.suffix} holds one moment: motion is left out")
        for line in more:
            note(line)
        with ConsolePhases().phase("write and compare"):
            checks = export_moment(scene, time_s, self.file, self.spz_version)
        note(f"wrote {self.file} ({len(scene.gaussians):,} Gaussians at {time_s:g} s)")
        self._report(checks, (*lost, *more))

    def _write_sequence(self, scene: "Scene", lost: tuple[str, ...]) -> None:
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.outputs.splat_export import export_sequence

        more = _dilation_notes(scene)
        for line in more:
            note(line)
        times_s = file_times_s(scene, self.fps)
        with ConsolePhases().phase("write PLY", len(times_s)) as advance:
            checks = export_sequence(scene, self.file, times_s, advance)
        note(f"wrote {len(times_s)} files to {self.file}")
        self._report(checks, (*lost, *more))

    def _report(self, checks: Sequence["ExportCheck"], lost: Sequence[str]) -> None:
        """Print and store what the file shows."""
        from diff4splat.cli.common.console import note
        from diff4splat.outputs.export_check import write_record

        record = write_record(self.file, checks, lost)
        for check in checks:
            note(
                f"read again by {check.reader} and rendered: {check.worst_db:.1f} dB to the scene "
                f"in the worst of {len(check.rows)} images (floor {check.floor_db:g} dB)"
            )
        note(f"all of them: {record}")


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


def _dilation_notes(scene: "Scene") -> tuple[str, ...]:
    from diff4splat.scene.scene import DILATION_PX2

    if scene.dilation_px2 >= DILATION_PX2:
        return ()
    return (
        f"made for a dilation of {scene.dilation_px2:g} px², which the file cannot say: "
        f"viewers add {DILATION_PX2:g} and show it softer",
    )
