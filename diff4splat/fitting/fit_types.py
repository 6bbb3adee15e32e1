"""Inputs and outputs of a fit."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from diff4splat.data.capture.capture import Capture
from diff4splat.data.capture.split import SplitReport
from diff4splat.fitting.evaluator import FrameQuality
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.settings import FitSettings
from diff4splat.progress.phases import Phases
from diff4splat.progress.skipped import SkippedWorkList
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.scene import Scene


def _silent(text: str) -> None:
    """Ignore a message."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRequest:
    """Inputs of a fit."""

    capture: Capture
    settings: FitSettings
    folder: Path
    """For the checkpoint and the log."""
    init: Scene | None = None
    """Initial scene; replaces the coarse stage."""
    backend: str = "auto"
    """Renderer of the frames."""
    device: str = "cpu"
    """Where frames are rasterised."""
    stop_after_s: float | None = None
    """Time limit of this call."""
    phases: Phases = field(default_factory=Phases)
    note: Callable[[str], None] = _silent
    show: Callable[[Callable[[], Scene]], None] | None = None
    """Called after every step with what makes the scene as it is now."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """The fitted scene and its quality."""

    gaussians: Gaussians
    motion: Motion
    split: SplitReport
    held_out: list[FrameQuality]
    training: list[FrameQuality]
    """Quality on a few training frames."""
    skipped_work: SkippedWorkList
    renderer: FrameRenderer
    cameras: CameraModel | None
    """Optimised cameras; None if no camera parameter was learned."""
    learned: dict[str, dict[str, object]]
    """Initial and recovered value of each learned camera parameter."""
    seconds: float
    finished: bool
    """False if the time limit stopped the fit; the same request resumes it."""
