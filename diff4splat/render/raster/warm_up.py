"""Warm-up of the rasteriser's kernels: a tiny scene with every output, forward and backward."""

from dataclasses import replace

import torch
from jaxtyping import Int
from torch import Tensor

from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.raster.function import rasterize
from diff4splat.render.raster.raster_settings import make_raster_settings, make_view
from diff4splat.render.raster.sequence import Sequence
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.scene import Provenance, Scene


def warm_up() -> None:
    """Call every kernel of the rasteriser once: one image with gradients, then a sequence."""
    gaussians = _gaussian()
    camera = pinhole(8.0, (8, 8))
    plan = make_raster_settings(camera, RenderSettings(), colors=True, medians=True)
    rasterize(plan, gaussians, gaussians.means.new_zeros(1, 0), camera).light.sum().backward()
    view = make_view(plan.grid, camera.world_from_camera, camera.focal_px, camera.center_px)
    for index in (torch.zeros(1, dtype=torch.long), torch.zeros(0, dtype=torch.long)):
        sequence = Sequence(_scene(gaussians, index, camera), plan, depths=True)
        sequence.draw(view, 0.0)
        sequence.draw(view, 0.0)


def _scene(gaussians: Gaussians, moving: Int[Tensor, " m"], camera: Camera) -> Scene:
    keys = gaussians.means.new_zeros(1, len(moving), 4)
    return Scene(
        gaussians=gaussians,
        motion=KeyframeMotion(
            key_times_s=torch.zeros(1),
            moving_index=moving,
            offsets=keys[..., :3],
            rotations=keys,
            log_scale_offsets=keys[..., :3],
        ),
        path=CameraPath(cameras=camera.with_pose(torch.eye(4)[None]), times_s=torch.zeros(1)),
        provenance=Provenance(generator="warm"),
    )


def _gaussian() -> Gaussians:
    one = Gaussians(
        means=torch.tensor([[0.0, 0.0, 1.0]], device="cpu"),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]], device="cpu"),
        scales=torch.full((1, 3), 0.1, device="cpu"),
        opacities=torch.full((1,), 0.5, device="cpu"),
        sh=torch.zeros(1, 1, 3, device="cpu"),
    ).to(torch.float32)
    return replace(one, opacities=one.opacities.requires_grad_())
