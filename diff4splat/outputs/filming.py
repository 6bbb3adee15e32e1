"""Frames along a path, one in memory at a time, and what is kept of them for the other outputs.

Axes: ``t`` frames, ``h w`` pixels, ``s`` frames of the contact sheet.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import DEFAULTS, render, render_video
from diff4splat.render.settings import RenderOutput, RenderSettings
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

SHEET_FRAMES = 5
COVERED = 0.5
"""Alpha from which a pixel shows the scene and not the background."""
MIN_EMPTY_SHARE = 0.01
"""Share of a frame below which what shows nothing is not worth a line."""


@dataclass(slots=True)
class FilmRecord:
    """What the outputs beside the video need of a path's frames."""

    path: CameraPath
    with_depth: bool = True
    settings: RenderSettings = DEFAULTS
    device: str = "cpu"
    """Where frames are rendered; what is kept is on the CPU."""
    first_rgb: Float[Tensor, "h w 3"] | None = None
    sheet_rgb: list[Float[Tensor, "h w 3"]] = field(default_factory=list)
    depth: Float[Tensor, "t h w"] | None = None
    """Expected depth, 0 where nothing is seen; None when it was not asked for."""
    empty_share: float = 0.0
    """Largest share of a frame in which nothing of the scene shows."""
    emptiest_frame: int = 0

    @property
    def sheet_index(self) -> Int[Tensor, " s"]:
        """Frames of the contact sheet, spread evenly."""
        count = len(self.path)
        return torch.linspace(0, count - 1, min(count, SHEET_FRAMES)).round().long().unique()

    def add(self, index: int, frame: RenderOutput) -> None:
        """Keep what is needed of frame ``index``."""
        if index == 0:
            self.first_rgb = frame.rgb.clamp(0, 1)
        if index in self.sheet_index.tolist():
            self.sheet_rgb.append(frame.rgb.clamp(0, 1))
        if self.with_depth:
            if self.depth is None:
                self.depth = frame.depth.new_empty(len(self.path), *frame.depth.shape)
            self.depth[index] = frame.depth
        empty = float((frame.alpha < COVERED).float().mean())
        if empty > self.empty_share:
            self.empty_share, self.emptiest_frame = empty, index


def film(scene: Scene, record: FilmRecord, log: RunLog) -> Iterator[Float[Tensor, "h w 3"]]:
    """Every frame of the record's path in turn; ``record`` is complete after the last."""
    outputs = ("rgb", "alpha", "depth") if record.with_depth else ("rgb", "alpha")
    count = len(record.path)
    if isinstance(scene.motion, StaticMotion):
        log.record_skipped("states per frame", "nothing moves", f"{count - 1} scene states")
    if not record.with_depth:
        log.record_skipped("depth", "not asked for", f"{count} blended depth maps")
    with log.phases.phase("render", count) as advance, torch.no_grad():
        frames = render_video(
            on_device(scene, record.device),
            record.path,
            outputs=outputs,
            settings=record.settings,
            advance=advance,
        )
        for index, frame in enumerate(map(on_cpu, frames)):
            record.add(index, frame)
            yield frame.rgb


def on_device(scene: Scene, device: str) -> Scene:
    """The scene where it is rendered; gsplat then takes what is on a CUDA device."""
    return scene if torch.device(device).type == "cpu" else scene.to(torch.device(device))


def on_cpu(frame: RenderOutput) -> RenderOutput:
    """The same images, where files are written from."""
    images = {
        name: value.cpu()
        for name in ("rgb", "depth", "alpha")
        if (value := getattr(frame, name)) is not None
    }
    return replace(frame, **images)


def empty_note(scene: Scene, record: FilmRecord) -> str | None:
    """One line where the path leaves what the scene holds, beyond what its own first view does."""
    if record.empty_share < MIN_EMPTY_SHARE:
        return None
    time_s = float(scene.path.times_s[0])
    with torch.no_grad():
        own = render(scene, scene.path.cameras[0], time_s, outputs=("alpha",)).alpha
    if record.empty_share < float((own < COVERED).float().mean()) + MIN_EMPTY_SHARE:
        return None
    return (
        f"the path leaves the scene: nothing shows in up to {record.empty_share:.0%} of the frame "
        f"(frame {record.emptiest_frame}); a smaller amplitude stays inside"
    )
