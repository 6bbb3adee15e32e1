"""The video autoencoder: pictures in, the same pictures out, through a narrow latent."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.image import psnr
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.losses.autoencoder import charbonnier, posterior_divergence
from diff4splat.training.losses.photometric import perceptual_error
from diff4splat.training.stage import TOTAL
from diff4splat.training.stages.model_stage import ModelStage, network_video, shown_video
from diff4splat.training.stages.panels import panel


class AutoencoderStage(ModelStage):
    """Reconstruction, perceptual distance and a weak pull of the latents to N(0, 1)."""

    parts = ("vae",)

    def forward(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """Terms ``pixels``, ``perceptual`` and ``divergence``."""
        weights, video = self.plan.recipe.losses, network_video(batch)
        latent = self.vae.encode(video)
        decoded = self.vae.decode(latent.sample(self.noise(batch, latent.mean, "posterior")))
        terms = {"pixels": charbonnier(decoded, video)}
        terms["divergence"] = posterior_divergence(latent.mean, latent.log_variance)
        total = weights.photometric * terms["pixels"] + weights.divergence * terms["divergence"]
        if weights.perceptual:
            shown, truth = shown_video(decoded), shown_video(video)
            terms["perceptual"] = perceptual_error(shown, truth, self.plan.features)
            total = total + weights.perceptual * terms["perceptual"]
        return terms | {TOTAL: total}

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Mapping[str, Float[Tensor, " b"]]:
        """PSNR of the decoded video, without noise in the latent."""
        return {"psnr": psnr(self._decoded(batch), unit_rgb(batch.video)).mean(1)}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Truth above what is decoded, over time."""
        truth, decoded = unit_rgb(batch.video)[0], self._decoded(batch)[0]
        return panel([("truth", list(truth)), ("decoded", list(decoded))])

    def _decoded(self, batch: ClipBatch) -> Float[Tensor, "b f h w 3"]:
        return shown_video(self.vae.decode(self.encode(batch))).clamp(0, 1)
