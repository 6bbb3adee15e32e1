"""Predicted scenes, their renders and displacements, with gradients.

All that stages ask of LDRM, the deformation network and the Gaussians they give is here.

Axes: ``b`` batch, ``m`` target times, ``p`` views per time, ``n`` tracked points, ``h w`` pixels.
Scenes and renders are float32 whatever the networks run in. Nothing is pruned: later frames of the
plane prior start below the pruning threshold and could otherwise never be raised; renderers skip
contributions below ``alpha_cutoff``, which is lowered for the same reason.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Float, Int
from torch import Tensor

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.video.canonical_scene import (
    CanonicalScene,
    reconstruct,
    reconstruct_refined,
)
from diff4splat.geometry import quaternion
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.deformation.keyframes import (
    DeformationState,
    DeformationUnits,
    deformation_state,
    raw_scales,
)
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH, plane_base
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.ldrm.refinement.start_distance import with_start_distance
from diff4splat.models.networks import Networks
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import camera_rays
from diff4splat.training.stages.model_stage import StagePlan
from diff4splat.training.stages.moment_images import Moment, images_of


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedScenes:
    """Renders of the predicted scenes at the targets."""

    rgb: Float[Tensor, "b m p h w 3"]
    depth: Float[Tensor, "b m p h w"]
    offsets: Float[Tensor, "b m n 3"] | None
    """Displacements of the tracked points; None without a deformation network."""
    input_depth: Float[Tensor, "b k h w"] | None = None
    """Predicted z of the keyframes' pixels, before rendering; only with a refinement decoder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenePredictor:
    """Scenes of a batch by the networks of a stage."""

    networks: Networks
    plan: StagePlan

    def render_static(
        self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]
    ) -> RenderedScenes:
        """Every target shows the canonical scene; the deformation network does not run."""
        video = self.posed_video(batch, latent)
        maps = self.networks.ldrm(latent, camera_rays(batch.cameras), video, moving=False)
        with torch.autocast(latent.device.type, enabled=False):
            scenes = canonical_scenes(maps, batch, self.plan.model, video)
            rendered = _static_images(scenes, batch, self.plan.defer_renders)
            return _with_input_depth(rendered, maps, self.plan.model)

    def render_dynamic(
        self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]
    ) -> RenderedScenes:
        """Every target shows the scene deformed to its time."""
        model, video = self.plan.model, self.posed_video(batch, latent)
        maps = self.networks.ldrm(latent, camera_rays(batch.cameras), video)
        deformations = self._deformations(maps, batch)
        with torch.autocast(latent.device.type, enabled=False):
            scenes = canonical_scenes(maps, batch, model, video)
            rendered = _dynamic_images(scenes, deformations, batch, self.plan)
            return _with_input_depth(rendered, maps, model)

    def displacements(
        self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]
    ) -> Float[Tensor, "b m n 3"]:
        """Displacements of the tracked points at the target times, without rendering."""
        video = self.posed_video(batch, latent)
        maps = self.networks.ldrm(latent, camera_rays(batch.cameras), video)
        return track_offsets(self._deformations(maps, batch), batch, self.plan.model)

    @torch.no_grad()
    def posed_video(
        self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]
    ) -> PosedVideo | None:
        """Input of the refinement decoder, at the depth prior's depth if it uses that.

        None where the model has no such decoder.
        """
        if not self.plan.model.refinement.used:
            return None
        video = PosedVideo(rgb=self._frames(batch, latent), cameras=batch.cameras)
        return with_start_distance(video, self.networks.monocular_depth, self.plan.model)

    def _frames(
        self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]
    ) -> Float[Tensor, "b 3 f h w"]:
        """The true first frame, then decoded frames.

        Recipes may take true frames instead of decoding, which is about a fifth of a dynamic step.
        """
        truth = unit_rgb(batch.video).movedim(-1, 1)
        if self.plan.recipe.use_ground_truth_frames:
            return truth
        decoded = (self.networks.vae.decode(latent).float() + 1) / 2
        return torch.cat([truth[:, :, :1], decoded[:, :, 1:].clamp(0, 1)], 2)

    def _deformations(self, maps: RawGaussianMaps, batch: ClipBatch) -> list[Tensor]:
        """Raw maps (b, 10, …) at every target time."""
        times = batch.target_time.unbind(1)
        return list(self.networks.deformation.at_times(maps.tokens, times))


def canonical_scenes(
    maps: RawGaussianMaps, batch: ClipBatch, model: ModelConfig, video: PosedVideo | None
) -> list[CanonicalScene]:
    """One set of Gaussians per sample, from its first input image or from its posed ``video``."""
    scenes = []
    for index in range(len(batch)):
        sample = maps.sample(index)
        if video is not None:
            posed = video.sample(index)
            scenes.append(reconstruct_refined(sample, posed, model.activation, RunLog()))
            continue
        image = first_image(batch, index)
        base = plane_base(image.rgb, image.camera, batch.cameras[index], model.ldrm.grid_stride)
        scenes.append(reconstruct(sample, base, model.activation))
    return scenes


def first_image(batch: ClipBatch, index: int) -> InputImage:
    """The first frame of one sample."""
    return InputImage(
        rgb=unit_rgb(batch.video[index, 0]), camera=batch.cameras[index][0], focal_source="clip"
    )


def log_depth(raw: Float[Tensor, "n 1 h w"], model: ModelConfig) -> Float[Tensor, "n h w"]:
    """Logarithm of z of a depth network's raw maps."""
    return key_depth(raw.float(), model.activation)[:, 0].log()


def _static_images(scenes: list[CanonicalScene], batch: ClipBatch, defer: bool) -> RenderedScenes:
    def shown(index: int, time: int) -> Moment:
        del time
        return Moment(gaussians=scenes[index].gaussians)

    rgb, depth = _target_images(shown, batch, defer)
    return RenderedScenes(rgb=rgb, depth=depth, offsets=None)


def _dynamic_images(
    scenes: list[CanonicalScene], deformations: list[Tensor], batch: ClipBatch, plan: StagePlan
) -> RenderedScenes:
    """``deformations`` hold the raw maps of all samples, one tensor (b, 10, …) per target time."""

    def shown(index: int, time: int) -> Moment:
        scene = scenes[index]
        return Moment(
            gaussians=scene.gaussians,
            inputs=(deformations[time][index], scene.maps.gaussians),
            change=partial(_moved, scene, plan.model),
        )

    rgb, depth = _target_images(shown, batch, plan.defer_renders)
    offsets = track_offsets(deformations, batch, plan.model)
    return RenderedScenes(rgb=rgb, depth=depth, offsets=offsets)


def _moved(
    scene: CanonicalScene, model: ModelConfig, gaussians: Gaussians, raw: Tensor, maps: Tensor
) -> Gaussians:
    """The Gaussians of a scene at the time of a raw map; gradients follow the arguments."""
    scene = replace(scene, gaussians=gaussians, maps=replace(scene.maps, gaussians=maps))
    return deformed(gaussians, deformed_state(scene, raw, model))


def _target_images(
    shown: Callable[[int, int], Moment], batch: ClipBatch, defer: bool
) -> tuple[Float[Tensor, "b m p h w 3"], Float[Tensor, "b m p h w"]]:
    """Colour and depth of every sample (index) at every target time (index)."""
    images = []
    for index in range(len(batch)):
        targets = batch.target_cameras[index]
        times = range(batch.target_time.shape[1])
        images.append(_stack([images_of(shown(index, t), targets[t], defer) for t in times]))
    return _stack(images)


def track_offsets(
    deformations: list[Tensor], batch: ClipBatch, model: ModelConfig
) -> Float[Tensor, "b m n 3"]:
    """Displacements of tracked points from raw maps, one tensor (b, 10, …) per target time."""
    rows = []
    for index in range(len(batch)):
        cells = _cell_index(batch.track_cell[index], batch, model)
        rows.append(torch.stack([maps[index].flatten(1)[:3, cells] for maps in deformations]))
    return torch.stack(rows).float().mT * PLANE_DEPTH


def _with_input_depth(
    rendered: RenderedScenes, maps: RawGaussianMaps, model: ModelConfig
) -> RenderedScenes:
    if not model.refinement.used:
        return rendered
    return replace(rendered, input_depth=key_depth(maps.gaussians[:, -1], model.activation))


def deformed_state(
    scene: CanonicalScene, raw: Float[Tensor, "10 t h w"], model: ModelConfig
) -> DeformationState:
    """Difference of all Gaussians from the canonical ones at one time."""
    units = DeformationUnits(length_unit=PLANE_DEPTH, activation=model.activation)
    raw_scale = raw_scales(scene.maps.gaussians[0].float())[scene.cell_index]
    return deformation_state(raw.float(), raw_scale, scene.cell_index, units)


def deformed(gaussians: Gaussians, state: DeformationState) -> Gaussians:
    """The Gaussians at that time: mean + offset, quaternion ⊗ rotation, scale · exp(offset).

    Gaussians after the last of ``state`` are static.
    """
    count = len(state.offsets)
    moved, static = gaussians.select(slice(count)), gaussians.select(slice(count, None))
    moved = replace(
        moved,
        means=moved.means + state.offsets,
        quats=quaternion.multiply(moved.quats, state.rotations),
        scales=moved.scales * state.log_scale_offsets.exp(),
    )
    return concatenate([moved, static]) if len(static) else moved


def _stack(pairs: list[tuple[Tensor, Tensor]]) -> tuple[Tensor, Tensor]:
    rgb, depth = zip(*pairs, strict=True)
    return torch.stack(rgb), torch.stack(depth)


def _cell_index(
    cell: Int[Tensor, "n 3"], batch: ClipBatch, model: ModelConfig
) -> Int[Tensor, " n"]:
    """Index in the flattened grid of Gaussians of (frame, row, column) input pixels."""
    grid_stride = model.ldrm.grid_stride
    height, width = (side // grid_stride for side in batch.video.shape[2:4])
    frame, row, column = cell.unbind(-1)
    frame = frame // (TIME_STRIDE if model.refinement.used else 1)
    return (frame * height + row // grid_stride) * width + column // grid_stride
