"""``diff4splat fit``: posed, timed pictures of one scene to a scene file, with a quality card.

DATA ── read_capture ── fit_scene (coarse, fine) ── write_results
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.options.guard_overwrite import require_inputs_kept
from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from diff4splat.data.capture.capture import Capture
    from diff4splat.fitting.settings import FitSettings
    from diff4splat.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class CaptureOptions:
    """How the data are read."""

    format: str = "auto"
    """dnerf, neu3d, hypernerf, colmap, transforms, clips or cameras; auto looks at the files."""
    hold_out: tuple[int, ...] | None = None
    """Cameras to hold out, from 0; if left out, the rule of the format."""
    downscale: int = 1
    """Make pictures so many times smaller."""
    frame_step: int = 1
    """Take only every so manieth time."""
    fps: float | None = None
    """Frames per second, for formats that only count frames."""
    clip: str | None = None
    """Which clip of a folder of shards, or which effect of data sets of cameras."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Fit a scene to a video from several sides, or from a moving camera; run again to go on."""

    data: Annotated[Path, tyro.conf.Positional]
    """Folder or file with pictures, poses and times."""
    out: Path = Path("fit")
    """Folder for the scene, its card, a video, a comparison and the checkpoint."""
    motion: Literal["hexplane", "spacetime", "static"] = "hexplane"
    """A field that deforms Gaussians, native 4D Gaussians, or none."""
    options: Annotated[CaptureOptions, tyro.conf.arg(name="")] = field(
        default_factory=CaptureOptions
    )
    init: Path | None = None
    """Start from this scene file, such as a generated one, in place of points."""
    budget: int = 40_000
    """Never more Gaussians than this."""
    steps: int | None = None
    """Of the fine stage; if left out, the default of the motion."""
    minutes: float | None = None
    """Save and stop after so many minutes of this call."""
    no_depth: bool = False
    """Do not use depth where the data have it."""
    renderer: Literal["auto", "trace", "raster", "reference", "gsplat"] = "auto"
    """What makes pictures; auto follows rays where cameras are more than pinholes, else draws."""
    learn: tuple[Literal["lens", "focus", "aperture", "readout", "focal"], ...] = ()
    """Parts of the cameras that are recovered together with the scene, from a first guess in the
    data: lens coefficients, focus distance, aperture radius, read-out time, focal length."""
    seed: int = 0
    """Points, order of frames and splits derive from it."""
    set: Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction] = ()
    """Changes such as weights.ssim=0.2 or rates.means.first=1e-3; may be given again."""
    restart: bool = False
    """Forget what an earlier call left in the folder."""

    def run(self) -> None:
        """Check, read, fit, write."""
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.cli.installation import single_gaussian
        from diff4splat.cli.renderer import compile_ahead, prepare_renderer
        from diff4splat.fitting.checkpoint import FILE
        from diff4splat.fitting.fit import FitRun, fit_scene
        from diff4splat.fitting.frame_renderer import Sight
        from diff4splat.fitting.results import RESULT_FILES, FitReport, write_results
        from diff4splat.progress.run_log import RunLog
        from diff4splat.render.trace import warm as tracer

        settings = self.settings()
        outputs = [self.out / name for name in (*RESULT_FILES, FILE)]
        require_inputs_kept([self.data, *([self.init] if self.init else [])], outputs)
        log = RunLog(phases=ConsolePhases())
        capture, scene = self.capture(), self.initial_scene()
        for line in capture.notes:
            note(line)
        if self.renderer in ("auto", "raster"):
            prepare_renderer(single_gaussian("cpu"), log.phases)
        sight = Sight(capture=capture, backend=self.renderer, settings=settings.camera)
        if sight.traced and not tracer.is_ready():
            compile_ahead(tracer, log.phases)
        if self.restart:
            (self.out / FILE).unlink(missing_ok=True)
        asked = FitRun(
            capture=capture,
            settings=settings,
            folder=self.out,
            init=scene,
            backend=self.renderer,
            stop_after_s=None if self.minutes is None else 60 * self.minutes,
            phases=log.phases,
            note=note,
        )
        result = fit_scene(asked)
        report = FitReport(result=result, capture=capture, settings=settings, inputs=self.inputs())
        made = write_results(report, self.out, log)
        for line in result.omissions:
            note(f"left out: {line}")
        for line in recovered(result.learned):
            note(line)
        note(summary(report))
        moving = len(made.motion.moving_index)
        note(f"wrote {self.out} ({len(made.gaussians):,} Gaussians, {moving:,} of them moving)")
        if not result.finished:
            note("time is up; the same command goes on")

    def settings(self) -> "FitSettings":
        """Checked before anything is read."""
        from dataclasses import replace

        from diff4splat.fitting.settings import FitSettings
        from diff4splat.fitting.settings_json import changed

        if self.minutes is not None and not self.minutes > 0:
            raise ConfigError(f"--minutes: expected more than 0, got {self.minutes:g}")
        start = FitSettings(motion=self.motion, seed=self.seed, use_depth=not self.no_depth)
        start = replace(
            start,
            density=replace(start.density, budget=self.budget),
            camera=replace(start.camera, learn=self.learn),
        )
        if self.steps is not None:
            start = replace(start, fine_steps=self.steps)
        return changed(start, [one for given in self.set for one in given])

    def capture(self) -> "Capture":
        """The data."""
        from diff4splat.data_prep.readers.options import ReadOptions
        from diff4splat.data_prep.readers.registry import read_capture

        return read_capture(self.data, ReadOptions(**asdict(self.options)))

    def initial_scene(self) -> "Scene | None":
        """What to start from."""
        from diff4splat.io.scene_files.scene_file import load_scene

        return None if self.init is None else load_scene(self.init)

    def inputs(self) -> dict[str, object]:
        """Every option as given, for the card."""
        given = {name: value for name, value in asdict(self).items() if name != "options"}
        given |= asdict(self.options)
        return {
            name: str(value) if isinstance(value, Path) else value for name, value in given.items()
        }


def recovered(learned: "Mapping[str, Mapping[str, object]]") -> list[str]:
    """One line for each part of the cameras that was learned."""
    return [
        f"{name}: {shown(found['start'])} at the start, {shown(found['recovered'])} recovered"
        for name, found in learned.items()
    ]


def shown(value: "float | list[float]") -> str:
    """A number, or several, in four digits."""
    values = value if isinstance(value, list) else [value]
    return ", ".join(f"{one:.4g}" for one in values)


def summary(report) -> str:
    """Quality in one line."""
    from diff4splat.fitting.results import quality_facts

    held, trained = quality_facts(report.result.held_out), quality_facts(report.result.training)
    judged = "nothing held out"
    if held is not None:
        structure = "" if held["ssim"] is None else f", SSIM {held['ssim']:.3f}"
        judged = (
            f"held out ({report.result.split.kind}): {held['psnr_db']:.2f} dB{structure} over "
            f"{held['frames']} frames"
        )
    return f"{judged}; learnt from: {trained['psnr_db']:.2f} dB; {report.result.seconds:.0f} s"
