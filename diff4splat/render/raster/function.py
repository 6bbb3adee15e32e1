"""Rasterisation as one differentiable operation on float32 CPU tensors.

Axes: ``n`` Gaussians, ``k`` harmonics, ``e`` extra channels, ``c`` all channels, ``h w`` pixels.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int32
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.render.raster import forward as stages
from diff4splat.render.raster.backward import Drawn, gradients
from diff4splat.render.raster.padded_image import PaddedImage
from diff4splat.render.raster.raster_settings import RasterSettings, make_view
from diff4splat.render.raster.tables import Cloud
from diff4splat.render.saturate import saturate_
from diff4splat.scene.gaussians import Gaussians


@dataclass(frozen=True, slots=True, kw_only=True)
class Raster:
    """The planes of an image, before the background."""

    planes: Float[Tensor, "c h w"]
    light: Float[Tensor, "h w"]
    """How much of what lies behind is seen."""
    medians: Int32[Tensor, "m h w"]
    """Which Gaussian halves the light, or -1; m is 0 unless asked for."""
    unusable: tuple[int, ...]
    """Gaussians left out because of means, quats, scales, opacities, sh."""


def rasterize(
    plan: RasterSettings, gaussians: Gaussians, extras: Float[Tensor, "n e"], camera: Camera
) -> Raster:
    """Blend colours and ``extras`` of Gaussians; gradients reach all tensors."""
    unusable: list[int] = []
    planes, light, medians = _Rasterize.apply(
        plan,
        unusable,
        gaussians.means,
        gaussians.quats,
        gaussians.scales,
        gaussians.opacities,
        gaussians.sh,
        extras,
        camera.world_from_camera,
        camera.focal_px,
        camera.center_px,
    )
    grid, used = plan.grid, (3 if plan.colors else 0) + extras.shape[1]
    return Raster(
        planes=planes[:used, : grid.height, : grid.width],
        light=light[0, : grid.height, : grid.width],
        medians=medians[:, : grid.height, : grid.width],
        unusable=tuple(unusable),
    )


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, plan: RasterSettings, unusable: list[int], *tensors: Tensor
    ) -> tuple[Tensor, ...]:
        cloud, sh, extras, pose, focal_px, center_px = _unpack(tensors)
        view = make_view(plan.grid, pose, focal_px, center_px)
        found = stages.footprints(cloud, sh, view, plan)
        unusable.extend(found.unusable.tolist())
        values = stages.channel_table(plan, cloud, sh, extras, view, found.visible)
        image = PaddedImage(plan.grid, values.shape[1], plan.medians)
        binned = stages.bin_footprints(found, plan)
        for region in binned.regions:
            filled = stages.fill_region(found, plan.grid, binned, region)
            stages.blend_region(plan, filled, found, values, image)
        if any(ctx.needs_input_grad):
            ctx.save_for_backward(*tensors)
            kept = filled if len(binned.regions) == 1 else None
            ctx.drawn = Drawn(
                plan=plan, view=view, footprints=found, values=values, image=image, binned=binned,
                filled=kept,
            )  # fmt: skip
        medians = image.padded(image.medians)
        ctx.mark_non_differentiable(medians)
        # Whole planes, because views of several results could not be changed in place.
        return image.padded(image.planes), image.padded(image.light), medians

    @staticmethod
    def backward(ctx: Any, planes: Tensor, light: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        if torch.is_grad_enabled():
            raise RuntimeError(
                "raster: expected create_graph=False, got True; use backend='reference' to "
                "differentiate twice"
            )
        cloud, sh, extras, pose, *_ = _unpack(ctx.saved_tensors)
        incoming = torch.cat([planes.flatten(), light.flatten()]).numpy()
        made = gradients(ctx.drawn, cloud, sh, incoming)
        start = 3 if ctx.drawn.plan.colors else 0
        camera = saturate_(torch.from_numpy(made.camera).to(pose))
        to_pose = torch.zeros_like(pose)
        to_pose[:3, :3], to_pose[:3, 3] = camera[:9].view(3, 3), camera[9:12]
        return (
            None,
            None,
            *(saturate_(torch.from_numpy(array)) for array in made.cloud),
            torch.from_numpy(made.sh),
            torch.from_numpy(made.values[:, start : start + extras.shape[1]].copy()),
            to_pose,
            camera[12:14],
            camera[14:],
        )


def _unpack(tensors: tuple[Tensor, ...]) -> tuple[Any, ...]:
    """(cloud, sh, extras) as arrays, and the camera's tensors."""
    plain = [tensor.detach().contiguous() for tensor in tensors]
    arrays: list[np.ndarray] = [tensor.numpy() for tensor in plain[:6]]
    return Cloud(*arrays[:4]), *arrays[4:], *plain[6:]
