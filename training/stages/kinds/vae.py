"""The video autoencoder: frames in, the same frames out, through a narrow latent."""

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.io.pixels import unit_rgb
from diff4splat.metrics.image import psnr
from diff4splat.training.batches.clip_batch import ClipBatch
from diff4splat.training.latents.video_latents import encode_video, image_video, network_video
from diff4splat.training.losses.autoencoder import charbonnier, kl_divergence
from diff4splat.training.losses.photometric import perceptual_error
from diff4splat.training.stages.loss_terms import LossTerm, weighted_sum
from diff4splat.training.stages.model_stage import ModelStage, Terms
from diff4splat.training.stages.previews import preview


class AutoencoderStage(ModelStage):
    """Reconstruction, perceptual distance and a weak pull of the latents to N(0, 1)."""

    parts = ("vae",)

    def forward(self, batch: ClipBatch) -> Terms:
        """Terms ``photometric``, ``kl`` and ``perceptual``."""
        weights, video = self.plan.recipe.losses, network_video(batch)
        latent = self.vae.encode(video)
        noise = self.random.normal(batch, latent.mean, "posterior")
        decoded = self.vae.decode(latent.sample(noise))
        return weighted_sum(
            [
                LossTerm(
                    name="photometric",
                    weight=weights.photometric,
                    compute=lambda: charbonnier(decoded, video),
                ),
                LossTerm(
                    name="kl",
                    weight=weights.kl,
                    compute=lambda: kl_divergence(latent.mean, latent.log_variance),
                ),
                LossTerm(
                    name="perceptual",
                    weight=weights.perceptual,
                    compute=lambda: perceptual_error(
                        image_video(decoded), image_video(video), self.plan.features
                    ),
                ),
            ]
        )

    @torch.no_grad()
    def measure(self, batch: ClipBatch) -> Terms:
        """PSNR of the decoded video, without noise in the latent."""
        return {"psnr": psnr(self._decoded(batch), unit_rgb(batch.video)).mean(1)}

    @torch.no_grad()
    def panel(self, batch: ClipBatch) -> Float[Tensor, "h w 3"]:
        """Truth above the decoded video, over time."""
        truth, decoded = unit_rgb(batch.video)[0], self._decoded(batch)[0]
        return preview([("truth", list(truth)), ("decoded", list(decoded))])

    def _decoded(self, batch: ClipBatch) -> Float[Tensor, "b f h w 3"]:
        return image_video(self.vae.decode(encode_video(self.vae, batch))).clamp(0, 1)
