"""A scene file that is compared with its scene before it appears.

The file is read again and rendered at the first, the middle and the last frame of the scene's path.
"""

from dataclasses import dataclass
from pathlib import Path

import torch

from diff4splat.io.scene_files.compression import Compression
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

VIEWS = 3
LEAST_PSNR_DB = 45.0
"""A file that shows less is written without loss."""
BEST_PSNR_DB = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneFileFacts:
    """What became of a scene in its file, for ``card.json``."""

    compression: Compression
    """The one that was used."""
    bytes: int
    psnr_db: float | None
    """Of the worst view against the scene; None without loss."""

    def __str__(self) -> str:
        size = f"{self.bytes / 1e6:.1f} MB, {self.compression}"
        return size if self.psnr_db is None else f"{size}: {self.psnr_db:.1f} dB to the scene"


def write_scene(scene: Scene, file: Path, compression: Compression) -> SceneFileFacts:
    """Write the scene, and without loss if the file would show something else.

    Raises:
        InputError: the scene holds what no file can.
        OutputError: the folder cannot be made or written.
    """
    save_scene(scene, file, compression)
    measured = None
    if compression != "lossless":
        measured = round(worst_view_psnr_db(scene, load_scene(file)), 2)
        if measured < LEAST_PSNR_DB:
            return write_scene(scene, file, "lossless")
    return SceneFileFacts(compression=compression, bytes=file.stat().st_size, psnr_db=measured)


@torch.no_grad()
def worst_view_psnr_db(scene: Scene, other: Scene) -> float:
    """Lowest PSNR of two scenes at frames spread over the first one's path, in dB."""
    count = len(scene.path)
    frames = torch.linspace(0, count - 1, min(count, VIEWS)).round().long().unique().tolist()
    worst = BEST_PSNR_DB
    for frame in frames:
        camera, time_s = scene.path.cameras[frame], float(scene.path.times_s[frame])
        images = [render(one, camera, time_s).rgb.clamp(0, 1) for one in (scene, other)]
        worst = min(worst, float(psnr(*images)))
    return worst
