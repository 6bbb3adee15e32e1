"""One picture to a scene that moves as told: what generation shows along its path.

    picture ─ vae (frozen) ─ latent ─ ldrm ─ Gaussians ─ match colours ─ move ─ render ─ losses
    truth ──────────────────────────── motion per cell ───────────────────┘

What lies behind things that move away and what the camera uncovers are learnt from the pictures in
which they are seen; so is depth, where no network of its own tells it. Some steps are given whole
videos instead, moved by the deformation network: without them LDRM forgets how to read one within a
few hundred steps. Colours are matched to the picture as generation does, so that everything else
suits the colours that are shown in the end; no gradient passes the matching.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.color_matching import InputGrid, matched_colors
from diff4splat.generation.input_image import InputImage
from diff4splat.generation.reconstruction import Canonical, states_from_offsets
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.factory import Networks
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.motion_features import key_depth
from diff4splat.models.motion_unet.motion_field import masked_offsets, upsample_to_pixels
from diff4splat.scene.gaussians import Gaussians
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.stages.model_stage import StagePlan, network_rays
from diff4splat.training.stages.prediction import (
    Rendered,
    canonical_scenes,
    deformed,
    first_picture,
    target_pictures,
    with_depth,
)
from diff4splat.training.stages.reconstruction import DynamicStage


class ImageTo4dStage(DynamicStage):
    """LDRM from first pictures, judged at any time; where things go is known.

    Their depth stays as stage ``depth`` has taught it, from far more pictures.
    """

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__(networks, plan)
        if self.ldrm.detail is not None and self.ldrm.detail.picture_depth is not None:
            self.ldrm.detail.picture_depth.requires_grad_(False)

    def given(self, batch: ClipBatch) -> ClipBatch:
        """The first picture alone, and in some steps of training the whole video."""
        return super().given(batch) if self.training else batch.first_picture()

    def render(self, batch: ClipBatch, latent: Float[Tensor, "b c t h2 w2"]) -> Rendered:
        """Pictures of the moved scenes at the targets; a video is moved by what is seen in it."""
        if batch.video.shape[1] > 1:
            return super().render(batch, latent)
        sight = self.sight(batch, latent)
        maps = self.ldrm(latent, network_rays(batch), sight, moving=False)
        with torch.autocast(latent.device.type, enabled=False):
            scenes = canonical_scenes(maps, batch, self.plan.model, sight)
            return with_depth(self.told_pictures(scenes, maps, batch), maps, self.plan.model)

    def told_pictures(
        self, scenes: list[Canonical], maps: RawGaussianMaps, batch: ClipBatch
    ) -> Rendered:
        """Every target shows its own moment of the scene, moved by the motion of the batch."""
        depth = key_depth(maps.gaussians[:, -1], self.plan.model.activation)[:, 0]
        moved = []
        for index, scene in enumerate(scenes):
            picture = first_picture(batch, index)
            told = masked_offsets(
                upsample_to_pixels(batch.field[index]), batch.moving[index], depth[index]
            )
            states = states_from_offsets(scene, told, batch.target_time[index].tolist())
            shown = matched(scene, picture)
            moved.append([deformed(shown, state) for state in states])
        rgb, depths = target_pictures(moved, batch)
        return Rendered(rgb=rgb, depth=depths, offsets=None)


def matched(scene: Canonical, picture: InputImage) -> Gaussians:
    """The Gaussians at rest with the colours that generation would give them."""
    grid = InputGrid(picture=picture, stride=1, cells=scene.every_cell)
    own = scene.gaussians
    sh = matched_colors(own, grid, GenerationSettings().color_steps)
    return replace(own, sh=own.sh + (sh - own.sh).detach())
