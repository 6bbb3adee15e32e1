"""A scene at one time as a file for other programs, compared with the scene before it appears."""

from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import OutputError
from diff4splat.geometry.camera import Camera
from diff4splat.io.atomic import atomic_path
from diff4splat.io.splats.formats import SPLAT_FORMATS
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Scene

VIEWS = 3
BEST_PSNR_DB = 200.0


def export_moment(scene: Scene, time_s: float, file: Path) -> float:
    """Write the state at ``time_s`` by the ending of ``file``; returns the worst view's PSNR in dB.

    The file is read again, and rendered from cameras along the scene's path.

    Raises:
        InputError: a value is NaN, infinite or beyond float32.
        OutputError: the file shows something else than the scene, or cannot be written.
    """
    form, state = SPLAT_FORMATS[file.suffix.lower()], scene.state_at(time_s)
    with atomic_path(file) as temporary:
        form.write(state, temporary, time_s, 3)
        measured = worst_psnr_db(scene, state, form.read(temporary).gaussians)
        if not measured >= form.least_psnr_db:
            raise OutputError(
                f"{file}: expected images as in the scene, at least {form.least_psnr_db:g} dB, got "
                f"{measured:.1f} dB; choose .ply or .glb, which round nothing"
            )
    return measured


@torch.no_grad()
def worst_psnr_db(scene: Scene, left: Gaussians, right: Gaussians) -> float:
    """Lowest PSNR of the two from views spread over the scene's path."""
    count = len(scene.path)
    frames = torch.linspace(0, count - 1, min(count, VIEWS)).round().long().unique().tolist()
    found = []
    for frame in frames:
        camera = scene.path.cameras[frame]
        images = [_image(scene, gaussians, camera) for gaussians in (left, right)]
        found.append(min(float(psnr(*images)), BEST_PSNR_DB))
    return min(found)


def _image(scene: Scene, gaussians: Gaussians, camera: Camera) -> Float[Tensor, "h w 3"]:
    shown = replace(scene, gaussians=gaussians, motion=StaticMotion())
    return render(shown, camera).rgb.clamp(0, 1)
