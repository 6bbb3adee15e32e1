"""Short fine-tuning on what generation makes by default: the picture alone, moved as it says.

True motion is noised to a random level and brought back by a few steps of the motion branch, so
that it is wrong as generated motion is wrong, and still shows the clip; the reconstruction is then
judged by renders of the truth (as ``joint`` does with latents). Generated motion carries no
gradient: rendering losses train the reconstruction, flow matching the branch.
"""

from collections.abc import Mapping
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.flow.path import velocity_from_clean
from diff4splat.generation.settings import MotionSettings
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.branch import MotionDiffusionStage
from diff4splat.training.stages.joint import STEPS
from diff4splat.training.stages.measures import reconstruction_measures
from diff4splat.training.stages.panels import reconstruction_panel
from diff4splat.training.stages.prediction import Rendered
from diff4splat.training.stages.terms import rendering_terms
from diff4splat.training.stages.told import ImageTo4dStage


class ImageTo4dFinetuneStage(MotionDiffusionStage, ImageTo4dStage):
    """Motion branch and reconstruction in one step."""

    parts = ("vae", "text_encoder", "dit", "ldrm", "deformation")

    def forward(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """The terms of both stages, and their sum as ``total``; no flow where it teaches nobody."""
        flow = MotionDiffusionStage.forward(self, batch) if "dit" in self.trained else {TOTAL: 0.0}
        batch = self.given(batch)
        rendered = self.generated(batch)
        scene = rendering_terms(rendered, batch, self.plan.recipe.losses, self.plan.features)
        return {**flow, **scene, TOTAL: flow[TOTAL] + scene[TOTAL]}

    def generated(self, batch: ClipBatch) -> Rendered:
        """Pictures at the targets; a first picture alone is moved after a detour through noise."""
        alone = batch.video.shape[1] == 1
        moved = self.regenerated(batch) if alone else batch
        return self.render(moved, self.encode(moved))

    @torch.no_grad()
    def regenerated(self, batch: ClipBatch) -> ClipBatch:
        """The clips, with motion after a detour through noise, from any level.

        What moves is what is likelier than generation asks for; colours do not share it here.
        """
        start = torch.cat([torch.rand(1, generator=own) for own in self.draw(batch, "detour")])
        noisy = self._noisy(batch, start.to(batch.field), "detour noise")
        motion = noisy.motion
        for step in range(STEPS):
            level = noisy.level * (1 - step / STEPS)
            answer, logits = self.dit.motion_branch.answers(*self._asked(batch, motion, level))
            velocity = velocity_from_clean(motion, answer, level[:, None, None, None, None])
            motion = motion - (noisy.level / STEPS)[:, None, None, None, None] * velocity
        field = torch.cat([batch.field[:, :, :1], motion], 2)
        moving = logits.sigmoid() > MotionSettings().moves_above
        return replace(batch, field=field, moving=moving)

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """Velocity error, and the scenes of regenerated motion."""
        batch = self.given(batch)
        measures = reconstruction_measures(self.generated(batch), batch)
        return {**MotionDiffusionStage.measure(self, batch), **measures}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """The scenes of regenerated motion."""
        batch = self.given(batch)
        return reconstruction_panel(self.generated(batch), batch)
