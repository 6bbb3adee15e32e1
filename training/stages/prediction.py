"""From maps to pictures and displacements, with gradients: what the rendering losses look at.

Axes: ``b`` batch, ``m`` target times, ``p`` views per time, ``n`` tracked points, ``h w`` pixels.
Everything here runs in float32 whatever the networks run in. Nothing is pruned: the base scene's
later frames start below the pruning threshold and could otherwise never be raised; renderers skip
contributions below ``alpha_cutoff``, which is lowered for the same reason.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.reconstruction import Canonical, reconstruct, reconstruct_detailed
from diff4splat.geometry import quaternion
from diff4splat.geometry.camera import Camera
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.deformation.keyframes import (
    DeformationState,
    DeformationUnits,
    deformation_state,
    raw_scales,
)
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH, UNSEEN, plane_base
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.training.batches.clip_batch import ClipBatch

SETTINGS = RenderSettings(alpha_cutoff=UNSEEN / 10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rendered:
    """What the predicted scenes look like at the targets."""

    rgb: Float[Tensor, "b m p h w 3"]
    depth: Float[Tensor, "b m p h w"]
    offsets: Float[Tensor, "b m n 3"] | None
    """Of the tracked points; None where no deformation network ran."""
    own_depth: Float[Tensor, "b k h w"] | None = None
    """z of the key frames' own pixels, before any rendering; only with a detail decoder."""


def canonical_scenes(
    maps: RawGaussianMaps, batch: ClipBatch, model: ModelConfig, sight: PosedVideo | None = None
) -> list[Canonical]:
    """One set of Gaussians per sample, around its first input picture, or around its ``sight``."""
    scenes = []
    for index in range(len(batch)):
        own = maps.sample(index)
        if sight is not None:
            scenes.append(
                reconstruct_detailed(own, sight.sample(index), model.activation, RunLog())
            )
            continue
        picture = first_picture(batch, index)
        base = plane_base(picture.rgb, picture.camera, batch.cameras[index], model.ldrm.grid_stride)
        scenes.append(reconstruct(own, base, model.activation))
    return scenes


def still_pictures(scenes: list[Canonical], batch: ClipBatch) -> Rendered:
    """Every target shows the canonical state: the deformation network is not executed."""
    times = batch.target_time.shape[1]
    rgb, depth = target_pictures([[scene.gaussians] * times for scene in scenes], batch)
    return Rendered(rgb=rgb, depth=depth, offsets=None)


def moving_pictures(
    scenes: list[Canonical], deformations: list[Tensor], batch: ClipBatch, model: ModelConfig
) -> Rendered:
    """``deformations`` hold the raw maps of all samples, one tensor (b, 10, …) per target time."""
    moved = []
    for index, scene in enumerate(scenes):
        states = [deformed_state(scene, maps[index], model) for maps in deformations]
        moved.append([deformed(scene.gaussians, state) for state in states])
    rgb, depth = target_pictures(moved, batch)
    return Rendered(rgb=rgb, depth=depth, offsets=track_offsets(deformations, batch, model))


def target_pictures(
    moments: list[list[Gaussians]], batch: ClipBatch
) -> tuple[Float[Tensor, "b m p h w 3"], Float[Tensor, "b m p h w"]]:
    """Colour and depth of every sample's Gaussians, one set per target time."""
    shown = []
    for index, moved in enumerate(moments):
        targets = batch.target_cameras[index]
        flat = [_pictures(gaussians, targets[time]) for time, gaussians in enumerate(moved)]
        shown.append(_stack(flat))
    return _stack(shown)


def track_offsets(
    deformations: list[Tensor], batch: ClipBatch, model: ModelConfig
) -> Float[Tensor, "b m n 3"]:
    """Displacements that raw maps, one tensor (b, 10, …) per target time, give followed points."""
    rows = []
    for index in range(len(batch)):
        cells = _cell_index(batch.track_cell[index], batch, model)
        rows.append(torch.stack([maps[index].flatten(1)[:3, cells] for maps in deformations]))
    return torch.stack(rows).float().mT * PLANE_DEPTH


def with_depth(rendered: Rendered, maps: RawGaussianMaps, model: ModelConfig) -> Rendered:
    """The same with the depth that the maps themselves claim."""
    if not model.detail.used:
        return rendered
    return replace(rendered, own_depth=key_depth(maps.gaussians[:, -1], model.activation))


def deformed_state(
    scene: Canonical, raw: Float[Tensor, "10 t h w"], model: ModelConfig
) -> DeformationState:
    """How all Gaussians differ from the canonical ones at one time."""
    units = DeformationUnits(length_unit=PLANE_DEPTH, activation=model.activation)
    raw_scale = raw_scales(scene.maps.gaussians[0].float())[scene.cells]
    return deformation_state(raw.float(), raw_scale, scene.cells, units)


def deformed(gaussians: Gaussians, state: DeformationState) -> Gaussians:
    """The Gaussians at that time: mean + offset, quaternion ⊗ rotation, scale · exp(offset).

    Those behind the last of ``state`` stand still.
    """
    count = len(state.offsets)
    moved, still = gaussians.select(slice(count)), gaussians.select(slice(count, None))
    moved = replace(
        moved,
        means=moved.means + state.offsets,
        quats=quaternion.multiply(moved.quats, state.rotations),
        scales=moved.scales * state.log_scale_offsets.exp(),
    )
    return concatenate([moved, still]) if len(still) else moved


def _pictures(gaussians: Gaussians, cameras: Camera) -> tuple[Tensor, Tensor]:
    output = render(gaussians, cameras, outputs=("rgb", "depth"), settings=SETTINGS)
    return output.rgb, output.depth


def _stack(pairs: list[tuple[Tensor, Tensor]]) -> tuple[Tensor, Tensor]:
    rgb, depth = zip(*pairs, strict=True)
    return torch.stack(rgb), torch.stack(depth)


def first_picture(batch: ClipBatch, index: int) -> InputImage:
    """What one sample starts from."""
    return InputImage(
        rgb=unit_rgb(batch.video[index, 0]), camera=batch.cameras[index][0], focal_source="clip"
    )


def _cell_index(
    cell: Int[Tensor, "n 3"], batch: ClipBatch, model: ModelConfig
) -> Int[Tensor, " n"]:
    """(frame, row, column) of input pixels to places in the flattened grid of Gaussians."""
    grid_stride = model.ldrm.grid_stride
    height, width = (side // grid_stride for side in batch.video.shape[2:4])
    frame, row, column = cell.unbind(-1)
    frame = frame // (TIME_STRIDE if model.detail.used else 1)
    return (frame * height + row // grid_stride) * width + column // grid_stride
