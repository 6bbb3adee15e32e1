"""Colours with which the render of the input view is the photograph, not a blur of it.

Neighbouring footprints overlap, so Gaussians that carry the pixels' colours render a softened
photograph (25 to 33 dB). Blending is linear in colour and each input pixel has its own Gaussian, so
Richardson iteration on the render itself undoes the blur:

    colour_i += photograph_i − render_i          (3 steps: 30 to 44 dB on the same photographs)

Colours stay in [0, 1]: what sharpens the input view must not ring in other views.
"""

from dataclasses import replace

from jaxtyping import Int
from torch import Tensor

from diff4splat.models.picture import Picture
from diff4splat.render.api import render
from diff4splat.report.run_log import RunLog
from diff4splat.scene.harmonics import color_from_dc, dc_from_color
from diff4splat.scene.scene import Scene


def match_input_view(
    scene: Scene, cells: Int[Tensor, " n"], picture: Picture, steps: int, log: RunLog
) -> Scene:
    """Correct the colour of each Gaussian whose grid cell is a pixel of ``picture``.

    ``cells`` holds the cell of every Gaussian in the grid of frames, rows and columns; those of the
    first frame come first. Only for grids as fine as the picture, where a cell is a pixel.
    """
    height, width = picture.camera.size_px
    own = (cells < height * width).nonzero()[:, 0]
    if steps == 0 or len(own) == 0:
        return scene
    start_s = scene.motion.time_range_s[0]
    with log.phases.phase("match colours", steps) as advance:
        for _ in range(steps):
            seen = render(scene, picture.camera, start_s).rgb
            residual = (picture.rgb.to(seen) - seen).flatten(0, 1)[cells[own]]
            scene = _add_color(scene, own, residual)
            advance()
    return scene


def _add_color(scene: Scene, own: Int[Tensor, " m"], change: Tensor) -> Scene:
    sh = scene.gaussians.sh.clone()
    sh[own, 0] = dc_from_color((color_from_dc(sh[own, 0]) + change).clamp(0, 1))
    return replace(scene, gaussians=replace(scene.gaussians, sh=sh))
