"""What a file shows against what the scene shows: both rendered from several views and times."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import OutputError
from diff4splat.geometry.camera import Camera
from diff4splat.io.atomic import write_text
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

VIEWS = 3
BEST_PSNR_DB = 200.0
"""Stands for identical images."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRow:
    """One image of the file against the same image of the scene."""

    frame: int
    """Of the scene's path, whose camera looks."""
    time_s: float
    psnr_db: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportCheck:
    """What one reader makes of a file."""

    reader: str
    floor_db: float
    rows: tuple[CheckRow, ...]

    @property
    def worst_db(self) -> float:
        """Of all images."""
        return min((row.psnr_db for row in self.rows), default=BEST_PSNR_DB)


@torch.no_grad()
def check_states(
    scene: Scene,
    state_at: Callable[[float], Gaussians],
    times_s: Iterable[float],
    reader: str,
    floor_db: float,
) -> ExportCheck:
    """Compare ``state_at`` of a file with the scene's, from cameras spread over its path."""
    count = len(scene.path)
    frames = torch.linspace(0, count - 1, min(count, VIEWS)).round().long().unique().tolist()
    rows = []
    for time_s in times_s:
        states = [scene.state_at(time_s), state_at(time_s)]
        for frame in frames:
            camera = scene.path.cameras[frame]
            images = [_image(scene, gaussians, camera) for gaussians in states]
            decibel = min(float(psnr(*images)), BEST_PSNR_DB)
            rows.append(CheckRow(frame=frame, time_s=time_s, psnr_db=round(decibel, 2)))
    return ExportCheck(reader=reader, floor_db=floor_db, rows=tuple(rows))


def require_floor(checks: Sequence[ExportCheck], file: Path, advice: str) -> None:
    """Refuse a file that shows something else than the scene.

    Raises:
        OutputError: a reader's worst image is under its floor.
    """
    for check in checks:
        if not check.worst_db >= check.floor_db:
            raise OutputError(
                f"{file}: expected images as in the scene, at least {check.floor_db:g} dB, got "
                f"{check.worst_db:.1f} dB (read by {check.reader}); {advice}"
            )


def write_record(file: Path, checks: Sequence[ExportCheck], lost: Sequence[str]) -> Path:
    """Write the checks beside ``file``, or into it if it is a folder; returns the record.

    Raises:
        OutputError: it cannot be written.
    """
    record = file / "check.json" if file.is_dir() else file.with_name(f"{file.name}.check.json")
    rows = [asdict(check) | {"worst_db": check.worst_db} for check in checks]
    content = {"file": file.name, "left_out": list(lost), "checks": rows}
    write_text(record, json.dumps(content, indent=1) + "\n")
    return record


def _image(scene: Scene, gaussians: Gaussians, camera: Camera) -> Float[Tensor, "h w 3"]:
    shown = replace(scene, gaussians=gaussians, motion=StaticMotion())
    return render(shown, camera).rgb.clamp(0, 1)
