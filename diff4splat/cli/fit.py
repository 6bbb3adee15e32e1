"""``diff4splat fit``: fits a scene to posed, timed images and reports its quality.

DATA ── read_capture ── fit_scene (coarse, fine) ── write_results
"""

from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.options.capture import CaptureOptions, inputs_for_card
from diff4splat.cli.options.constraints import InputPath, Number, OutFolder
from diff4splat.cli.options.device import render_device
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten
from diff4splat.errors import ConfigError, MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from diff4splat.data.capture.capture import Capture
    from diff4splat.fitting.fit_types import FitRequest, FitResult
    from diff4splat.fitting.results import FitReport
    from diff4splat.fitting.settings import FitSettings
    from diff4splat.progress.run_log import RunLog
    from diff4splat.scene.scene import Scene

DEFAULT_LIVE_PORT = 8080


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Fit a scene to multi-view or moving-camera video; the same command resumes a stopped fit."""

    data: Annotated[Path, tyro.conf.Positional, InputPath(what="images with poses")]
    """Folder or file with images, poses and times."""
    out: OutFolder = Path("fit")
    """Folder for the scene, its card, a video, a comparison and the checkpoint."""
    motion: Literal["hexplane", "spacetime", "static"] = "hexplane"
    """A field that deforms Gaussians, native 4D Gaussians, or none."""
    options: Annotated[CaptureOptions, tyro.conf.arg(name="")] = field(
        default_factory=CaptureOptions
    )
    init: Annotated[Path | None, InputPath(what="a scene file", folder=False)] = None
    """Start from this scene file, such as a generated one, in place of points."""
    budget: Annotated[int, Number(least=1)] = 40_000
    """Largest number of Gaussians."""
    steps: Annotated[int | None, Number(least=1)] = None
    """Steps of the fine stage; default: 2500."""
    minutes: Annotated[float | None, Number(above=0)] = None
    """Time limit of this call in minutes; the fit is saved and can be resumed."""
    no_depth: bool = False
    """Ignore depth in the data."""
    renderer: Literal["auto", "trace", "raster", "reference", "gsplat"] = "auto"
    """Renderer; auto traces rays if cameras differ from pinholes, and rasterises otherwise."""
    device: str = "cpu"
    """Where frames are rasterised: cpu, cuda (by gsplat), or auto, which is cuda where there is
    one. Rays are traced on the CPU."""
    dtype: Literal["float32", "float64"] = "float32"
    """Precision of the fit. float64 is the reference to check float32 against: slower, on the CPU,
    with the reference renderers."""
    learn: tuple[Literal["lens", "focus", "aperture", "readout", "focal"], ...] = ()
    """Camera parameters to optimise together with the scene, from an initial guess in the data:
    lens coefficients, focus distance, aperture radius, read-out time, focal length."""
    seed: Annotated[int, Number(least=0)] = 0
    """Seed of points, frame order and splits."""
    set: Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction] = ()
    """Override settings, such as weights.ssim=0.2 or rates.means.first=1e-3; repeatable."""
    compression: Literal["lossless", "standard", "small"] = "standard"
    """Of the scene file: every bit, fewer bytes without visible loss, or fewer than that."""
    live: Annotated[tuple[int, ...] | None, Number(least=1, most=65535)] = None
    """Show the scene in the browser while it is fitted, at this port of this machine; 8080 without
    one. Needs viser: pip install 'diff4splat[live]'."""
    restart: bool = False
    """Start again instead of resuming from the folder."""

    def check(self) -> None:
        """Check what float64 and the live view need."""
        self._check_dtype()
        if self.live is not None and len(self.live) > 1:
            raise ConfigError(f"--live: expected one port, got {len(self.live)}")
        if self.live is not None and find_spec("viser") is None:
            raise MissingExtraError(
                "--live: expected viser, got none installed; pip install 'diff4splat[live]'"
            )

    def _check_dtype(self) -> None:
        """Compiled renderers, GPUs and forecasts are for float32."""
        exact = self.renderer in ("auto", "trace", "reference") and self.device == "cpu"
        if self.dtype == "float64" and not exact:
            raise ConfigError(
                "--dtype float64: expected --renderer auto, trace or reference and the CPU, got "
                f"--renderer {self.renderer} --device {self.device}; leave out --dtype"
            )

    def run(self) -> None:
        """Check, then fit as the only writer of the folder."""
        from diff4splat.fitting.checkpoints.checkpoint import CHECKPOINT_FILE
        from diff4splat.fitting.results import RESULT_FILES
        from diff4splat.io.locks import sole_writer

        settings = self.settings()
        outputs = [self.out / name for name in (*RESULT_FILES, CHECKPOINT_FILE)]
        require_inputs_not_overwritten([self.data, *([self.init] if self.init else [])], outputs)
        with sole_writer(self.out):
            self._fit(settings)

    def _fit(self, settings: "FitSettings") -> None:
        """Read, fit, write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.fitting.results import FitReport, write_results
        from diff4splat.progress.run_log import RunLog

        log = RunLog(phases=ConsolePhases())
        request = self._request(settings, log)
        forecast = self._promised(request)
        self._precompile_tracer(request)
        if self.restart:
            self._checkpoint().unlink(missing_ok=True)
        result = self._fit_in_view(request)
        report = FitReport(
            result=result,
            capture=request.capture,
            settings=settings,
            inputs=inputs_for_card(self),
            forecast=forecast,
        )
        scene, scene_file = write_results(report, self.out, log, self.compression)
        moving = len(scene.motion.moving_index)
        for line in (
            *closing_lines(report),
            f"scene file: {scene_file}",
            f"wrote {self.out} ({len(scene.gaussians):,} Gaussians, {moving:,} of them moving)",
        ):
            note(line)
        if not result.finished:
            note("time is up; the same command goes on")

    def _request(self, settings: "FitSettings", log: "RunLog") -> "FitRequest":
        """What is fitted, and how; the data are read, and the renderer is compiled."""
        from diff4splat.cli.common.console import note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer
        from diff4splat.fitting.fit_types import FitRequest

        device, capture, initial = render_device(self.device), self.capture(), self.initial_scene()
        for line in capture.notes:
            note(line)
        if self._is_usual() and self.renderer in ("auto", "raster"):
            precompile_renderer(single_gaussian("cpu"), log.phases)
        return FitRequest(
            capture=capture,
            settings=settings,
            folder=self.out,
            init=initial,
            backend=self.renderer,
            device=device,
            stop_after_s=None if self.minutes is None else 60 * self.minutes,
            phases=log.phases,
            note=note,
        )

    def _promised(self, request: "FitRequest") -> "Callable[[], dict] | None":
        """Say what the fit will cost; returns what compares that with the truth, in the end."""
        from diff4splat.cli.limits.fitting import promise
        from diff4splat.cli.limits.stopwatch import Stopwatch

        promised = promise(self, request.settings, request.capture) if self._is_usual() else None
        watch = Stopwatch.of_process()
        if promised is None:
            return None
        if self.restart or not self._checkpoint().is_file():
            for line in promised.lines():
                request.note(line)
        return lambda: promised.record(watch.read())

    def _precompile_tracer(self, request: "FitRequest") -> None:
        """If the frames are traced."""
        from diff4splat.cli.common.precompile import precompile_tracer
        from diff4splat.fitting.frames.frame_renderer import FrameRenderer

        renderer = FrameRenderer(
            capture=request.capture,
            backend=self.renderer,
            settings=request.settings.camera,
            device=request.device,
        )
        if self._is_usual() and renderer.traced:
            precompile_tracer(request.phases)

    def _is_usual(self) -> bool:
        """Float32: what is compiled, and what forecasts were measured for."""
        return self.dtype == "float32"

    def _checkpoint(self) -> Path:
        from diff4splat.fitting.checkpoints.checkpoint import CHECKPOINT_FILE

        return self.out / CHECKPOINT_FILE

    def _fit_in_view(self, request: "FitRequest") -> "FitResult":
        """Fit, and serve the live view meanwhile if it is asked for."""
        from dataclasses import replace

        from diff4splat.cli.common.console import note
        from diff4splat.fitting.fit import fit_scene

        if self.live is None:
            return fit_scene(request)
        from diff4splat.outputs.live_view import LiveView

        port = self.live[0] if self.live else DEFAULT_LIVE_PORT
        with LiveView(port, request.capture.time_range_s) as view:
            note(f"live view: {view.address}")
            return fit_scene(replace(request, show=view.offer))

    def settings(self) -> "FitSettings":
        """The settings, checked before any data are read."""
        from dataclasses import replace

        from diff4splat.fitting.settings import FitSettings
        from diff4splat.fitting.settings_json import apply_changes

        start = FitSettings(
            motion=self.motion, dtype=self.dtype, seed=self.seed, use_depth=not self.no_depth
        )
        start = replace(
            start,
            density=replace(start.density, budget=self.budget),
            camera=replace(start.camera, learn=self.learn),
        )
        if self.steps is not None:
            start = replace(start, fine_steps=self.steps)
        return apply_changes(start, [one for given in self.set for one in given])

    def capture(self) -> "Capture":
        """The data."""
        return self.options.read(self.data)

    def initial_scene(self) -> "Scene | None":
        """The initial scene, if any."""
        from diff4splat.io.scene_files.scene_file import load_scene

        return None if self.init is None else load_scene(self.init)


def closing_lines(report: "FitReport") -> list[str]:
    """What was left out, what was learned, and how good the fit is."""
    left_out = [f"left out: {line}" for line in report.result.skipped_work]
    return [*left_out, *recovered(report.result.learned), summary(report)]


def recovered(learned: "Mapping[str, Mapping[str, object]]") -> list[str]:
    """One line per learned camera parameter."""
    return [
        f"{name}: {format_value(record['start'])} at the start,"
        f" {format_value(record['recovered'])} recovered"
        for name, record in learned.items()
    ]


def format_value(value: "float | list[float]") -> str:
    """One or several numbers with four digits."""
    values = value if isinstance(value, list) else [value]
    return ", ".join(f"{one:.4g}" for one in values)


def summary(report: "FitReport") -> str:
    """Quality in one line."""
    from diff4splat.fitting.results import quality_summary

    held, trained = quality_summary(report.result.held_out), quality_summary(report.result.training)
    quality = "nothing held out"
    if held is not None:
        structure = "" if held["ssim"] is None else f", SSIM {held['ssim']:.3f}"
        quality = (
            f"held out ({report.result.split.kind}): {held['psnr_db']:.2f} dB{structure} over "
            f"{held['frames']} frames"
        )
    return f"{quality}; learnt from: {trained['psnr_db']:.2f} dB; {report.result.seconds:.0f} s"
