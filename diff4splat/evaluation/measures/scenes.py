"""Metrics of the scene itself, for static clips: moving Gaussians and loop closure.

Axes: ``n`` Gaussians, ``t`` times. The closed path takes the whole time of the clip, so its last
image shows a later time from the same pose: it equals the first image only if nothing drifts. At a
fixed time, an explicit scene closes any loop by construction.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.evaluation.columns import PSNR_CAP_DB
from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.protocols.protocol import PathCheck, Protocol
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Score, Skip
from diff4splat.geometry.camera import Camera, project
from diff4splat.metrics.video import loop_closure_psnr
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.paths.build import build_path
from diff4splat.paths.camera_path import CameraPath
from diff4splat.paths.settings import PathFrame, PathSettings
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

NEAREST_DEPTH = 1e-3
"""Smallest depth of a Gaussian; also used for Gaussians behind the camera."""


def scene_entries(row: str, sample: EvalSample, scene: Scene, protocol: Protocol) -> Entries:
    """Fraction of moving Gaussians, and loop closure; both for static clips only."""
    if not sample.clip.note.is_static:
        why = "objects move in the clip"
        return [Skip(row=row, key=key, why=why) for key in ("moving_share", "loop_psnr")]
    camera, times_s = sample.input_view.cameras[0], sample.clip.times_s
    moving = moving_share(scene, camera, times_s, protocol.still_px)
    closed = loop_psnr(scene, check_path(protocol.loop, sample))
    return [
        Score(row=row, key="moving_share", value=round(moving, 6)),
        Score(row=row, key="loop_psnr", value=round(closed, 6)),
    ]


def moving_share(
    scene: Scene, camera: Camera, times_s: Float[Tensor, " t"], still_px: float
) -> float:
    """Fraction of Gaussians whose centres move more than ``still_px`` pixels of ``camera``."""
    start = scene.state_at(float(times_s[0])).means
    if len(start) == 0:
        return 0.0
    depth = project(camera.to(start.dtype), start)[1].clamp_min(NEAREST_DEPTH)
    largest = torch.zeros_like(depth)
    for time_s in times_s.tolist():
        displacement = (scene.state_at(time_s).means - start).norm(dim=-1)
        largest = torch.maximum(largest, displacement)
    displacement_px = largest * float(camera.focal_px.max()) / depth
    # Written so that NaN counts as moving.
    return 1.0 - float((displacement_px <= still_px).double().mean())


def loop_psnr(scene: Scene, path: CameraPath) -> float:
    """PSNR of the last against the first image of ``path``."""
    ends = [
        render(scene, path.cameras[end], float(path.times_s[end])).rgb.clamp(0, 1)
        for end in (0, -1)
    ]
    return float(loop_closure_psnr(torch.stack(ends)).clamp_max(PSNR_CAP_DB))


def check_path(check: PathCheck, sample: EvalSample) -> CameraPath:
    """A camera path that starts at the input camera and takes the whole time of the clip."""
    camera = sample.input_view.cameras[0].resized(check.size_px)
    view = PathFrame(camera=camera, near_depth=PLANE_DEPTH, focus_depth=PLANE_DEPTH)
    # A clip of a single time still needs increasing times.
    span_s = float(sample.clip.times_s[-1]) or 1.0
    settings = PathSettings(frames=check.frames, fps=(check.frames - 1) / span_s, easing="linear")
    return build_path(check.path, view, settings)
