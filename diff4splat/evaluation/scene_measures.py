"""What is judged on a scene itself: whether it stands still, and whether a closed path closes.

Axes: ``n`` Gaussians, ``t`` times. The loop's path runs through the whole time of the clip, so its
end shows the scene later from the same place: equal only if nothing drifts. At one moment an
explicit scene closes any loop by construction, so still clips are asked with the clock running.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.picture_measures import Entries
from diff4splat.evaluation.protocol import PathCheck, Protocol
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.sample import Case
from diff4splat.geometry.camera import Camera, project
from diff4splat.metrics.video import loop_closure_psnr
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.settings import PathFrame, PathSettings
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

NEAREST_DEPTH = 1e-3
"""Gaussians at or behind the camera count as this near."""


def scene_entries(row: str, case: Case, scene: Scene, protocol: Protocol) -> Entries:
    """Share of moving Gaussians and loop closure; both of still clips only."""
    if not case.clip.note.is_static:
        why = "things move in the clip"
        return [Skip(row=row, key=key, why=why) for key in ("moving_share", "loop_psnr")]
    moving = moving_share(scene, case.input_view.cameras[0], case.clip.times_s, protocol.still_px)
    closed = loop_psnr(scene, check_path(protocol.loop, case))
    return [
        Score(row=row, key="moving_share", value=round(moving, 6)),
        Score(row=row, key="loop_psnr", value=round(closed, 6)),
    ]


def moving_share(
    scene: Scene, camera: Camera, times_s: Float[Tensor, " t"], still_px: float
) -> float:
    """Share of Gaussians whose centres go farther than ``still_px`` pixels of ``camera``."""
    start = scene.state_at(float(times_s[0])).means
    if len(start) == 0:
        return 0.0
    depth = project(camera.to(start.dtype), start)[1].clamp_min(NEAREST_DEPTH)
    farthest = torch.zeros_like(depth)
    for time_s in times_s.tolist():
        away = (scene.state_at(time_s).means - start).norm(dim=-1)
        farthest = torch.maximum(farthest, away)
    moved_px = farthest * float(camera.focal_px.max()) / depth
    # Written so that NaN counts as moving.
    return 1.0 - float((moved_px <= still_px).double().mean())


def loop_psnr(scene: Scene, path: CameraPath) -> float:
    """Last against first picture of ``path``."""
    ends = [
        render(scene, path.cameras[end], float(path.times_s[end])).rgb.clamp(0, 1)
        for end in (0, -1)
    ]
    return float(loop_closure_psnr(torch.stack(ends)).clamp_max(PSNR_CAP_DB))


def check_path(check: PathCheck, case: Case) -> CameraPath:
    """A path around what the input camera sees, over the whole time of the clip."""
    camera = case.input_view.cameras[0].resized(check.size_px)
    view = PathFrame(camera=camera, near_depth=PLANE_DEPTH, focus_depth=PLANE_DEPTH)
    # A clip of a single moment still needs times that increase.
    span_s = float(case.clip.times_s[-1]) or 1.0
    settings = PathSettings(frames=check.frames, fps=(check.frames - 1) / span_s, easing="linear")
    return build_path(check.path, view, settings)
