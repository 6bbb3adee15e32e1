"""Latent video diffusion transformer: predicts the velocity noise − clean (layout of Wan 2.1).

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns, ``f hh ww``
video frames and pixels, ``d`` width, ``s`` text tokens. Noise level 0 is data and 1 is noise,
given per latent frame: an image condition overwrites latent frame 0 with the clean latent and
gives it level 0.

    latent ──────── patch 1×2×2 ─ linear ─┐
    render ──────── patch 1×2×2 ─ linear ─┤
    validity mask ─ patch 4×2×2 ─ linear ─┤
    camera ──────── adapter ──────────────┴ + ─ blocks ─ norm, modulate ─ linear ─ velocity
    level ─ sinusoid, MLP ─ modulation ────────┘ │
    text ── MLP ─ cross-attention ───────────────┘

A configuration may add what Wan's image-to-video weights have: channels beside the noisy ones
(``condition_channels``), and states of the image in the cross-attention (``image_width``).

The last linear layer is zero at first. Where the model predicts clean latents, that layer gives
what to add to the render condition (to 0, where there is none), and the velocity follows from it: a
fresh model leads any noise to the render condition.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.flow.path import velocity_from_clean
from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import ZeroModulation, modulate
from diff4splat.models.blocks.norm import EPSILON
from diff4splat.models.blocks.patches import unpatchify
from diff4splat.models.blocks.precision import at_least_float32
from diff4splat.models.blocks.rope import rope_tables
from diff4splat.models.blocks.time_embedding import EmbeddingMlp, level_embedding
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TOKEN_PATCH
from diff4splat.models.placement.shared_tokens import TokenGroup
from diff4splat.models.video_dit.camera_adapter import CameraAdapter
from diff4splat.models.video_dit.conditions import (
    DitConditions,
    ImageCondition,
    RenderCondition,
)
from diff4splat.models.video_dit.dit_block import MODULATIONS, DitBlock
from diff4splat.models.video_dit.image_attention import ImageProjection
from diff4splat.models.video_dit.padded_text import with_padding
from diff4splat.models.video_dit.patch_tokens import (
    channel_tokens,
    latent_tokens,
    require_render_condition,
)
from diff4splat.models.video_dit.render_condition import RenderConditionEmbedding

PATCH = (1, TOKEN_PATCH, TOKEN_PATCH)


class TextProjection(nn.Module):
    """Text states to the model's width: linear, tanh-GELU, linear."""

    def __init__(self, text_width: int, width: int) -> None:
        super().__init__()
        self.expand = nn.Linear(text_width, width)
        self.contract = nn.Linear(width, width)

    def forward(self, text: Float[Tensor, "b s e"]) -> Float[Tensor, "b s d"]:
        """Project every token separately."""
        return self.contract(torch.nn.functional.gelu(self.expand(text), approximate="tanh"))


class VideoDiT(nn.Module):
    """Velocity of a noisy latent under camera, text and image conditions."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        dit, channels = config.dit, config.vae.latent_channels
        self.config = dit
        self.latent_channels = channels
        inputs = channels + dit.condition_channels
        self.patch_embedding = nn.Linear(inputs * TOKEN_PATCH**2, dit.width)
        if dit.render_condition:
            self.condition_embedding = RenderConditionEmbedding(channels, dit.width)
        self.camera_adapter = CameraAdapter(dit.width, dit.camera_width, config.vae.space_stride)
        self.text_projection = TextProjection(config.text.width, dit.width)
        if dit.image_width:
            self.image_projection = ImageProjection(dit.image_width, dit.width)
        if dit.pooled_text:
            self.pooled_text = zero_(nn.Linear(dit.width, dit.width))
        self.level_mlp = EmbeddingMlp(dit.frequency_width, dit.width)
        self.level_modulation = ZeroModulation(dit.width, dit.width, MODULATIONS)
        self.blocks = nn.ModuleList([DitBlock(dit) for _ in range(dit.blocks)])
        self.norm_out = nn.LayerNorm(dit.width, eps=EPSILON, elementwise_affine=False)
        self.modulation_out = nn.Parameter(torch.zeros(2, dit.width))
        self.head = zero_(nn.Linear(dit.width, channels * TOKEN_PATCH**2))
        self.sharing: TokenGroup | None = None

    def share_tokens(self, sharing: TokenGroup | None) -> None:
        """Let processes that compute the same sample share its tokens."""
        self.sharing = sharing
        for block in self.blocks:
            block.attention.sharing = sharing

    def forward(
        self,
        latent: Float[Tensor, "b c t h w"],
        level: Float[Tensor, "b t"],
        camera: Float[Tensor, "b 6 f hh ww"] | None = None,
        text: Float[Tensor, "b s e"] | None = None,
        text_mask: Bool[Tensor, "b s"] | None = None,
        condition: RenderCondition | None = None,
        image: ImageCondition | None = None,
    ) -> Float[Tensor, "b c t h w"]:
        """Velocity in one call: ``prepare``, then ``velocity``.

        A sample without a real token in ``text_mask`` gets the output of one without text.
        """
        conditions = self.prepare(camera, text, text_mask, condition, image)
        return self.velocity(latent, level, conditions)

    def prepare(
        self,
        camera: Float[Tensor, "b 6 f hh ww"] | None = None,
        text: Float[Tensor, "b s e"] | None = None,
        text_mask: Bool[Tensor, "b s"] | None = None,
        condition: RenderCondition | None = None,
        image: ImageCondition | None = None,
    ) -> DitConditions:
        """Embed the conditions once for all steps of a sampler.

        Raises:
            ShapeError: a render condition is missing, or given to a model that takes none.
        """
        if text is not None and self.config.padded_text_tokens:
            text, text_mask = with_padding(text, text_mask, self.config.padded_text_tokens)
        require_render_condition(self.config.render_condition, condition)
        states = None if text is None else self.text_projection(text)
        pooled = self.config.pooled_text and states is not None
        return DitConditions(
            camera=None if camera is None else self.camera_adapter(camera),
            text=states,
            text_mask=text_mask,
            pooled_text=self._pooled(states, text_mask) if pooled else None,
            image=None if image is None else self._image_states(image),
            channel_tokens=None if image is None else self._channel_tokens(image),
            render_latent=None if condition is None else condition.latent,
            render_tokens=None if condition is None else self.condition_embedding(condition),
        )

    def _image_states(self, image: ImageCondition) -> Float[Tensor, "b i d"] | None:
        if image.states is None or not self.config.image_width:
            return None
        return self.image_projection(image.states)

    def _channel_tokens(self, image: ImageCondition) -> Float[Tensor, "b t h2 w2 d"] | None:
        """The part of the patch embedding that is the same at every step."""
        others = self.config.condition_channels
        return channel_tokens(self.patch_embedding, image.channels, PATCH, others)

    def _pooled(
        self, states: Float[Tensor, "b s d"], mask: Bool[Tensor, "b s"] | None
    ) -> Float[Tensor, "b d"]:
        """From the mean over real tokens."""
        if mask is None:
            return self.pooled_text(states.mean(1))
        real = mask[..., None].to(states)
        mean = (states * real).sum(1) / real.sum(1).clamp_min(1)
        return self.pooled_text(mean) * mask.any(1, keepdim=True)

    def velocity(
        self,
        latent: Float[Tensor, "b c t h w"],
        level: Float[Tensor, "b t"],
        conditions: DitConditions,
    ) -> Float[Tensor, "b c t h w"]:
        """Velocity at a noise level per latent frame."""
        tokens = latent_tokens(self.patch_embedding, latent, PATCH, self.config.condition_channels)
        if conditions.channel_tokens is not None:
            tokens = tokens + conditions.channel_tokens
        if conditions.camera is not None:
            tokens = tokens + conditions.camera
        if conditions.render_tokens is not None:
            tokens = tokens + conditions.render_tokens
        rows, columns = tokens.shape[2:4]
        rope = rope_tables(
            tuple(tokens.shape[1:4]), self.config.width // self.config.heads, tokens.device
        )
        embedding = self.level_mlp(level_embedding(level, self.config.frequency_width))
        if conditions.pooled_text is not None:
            embedding = embedding + conditions.pooled_text[:, None]
        modulation = self.level_modulation(embedding)
        tokens = tokens.flatten(2, 3)
        if self.sharing is not None:
            rope = self.sharing.split_rope(rope, tokens.shape[1])
            tokens = self.sharing.split(tokens, 2)
        for block in self.blocks:
            tokens = block(tokens, modulation, rope, conditions)
        if self.sharing is not None:
            tokens = self.sharing.join(tokens, 2)
        wide = at_least_float32(embedding)[..., None, :] + at_least_float32(self.modulation_out)
        shift, scale = wide[..., None, :].unbind(2)
        modulated = modulate(self.norm_out(at_least_float32(tokens)), shift, scale)
        patches = self.head(modulated.to(tokens.dtype))
        output = unpatchify(patches.unflatten(2, (rows, columns)), PATCH).to(latent.dtype)
        return self._as_velocity(output, latent, level, conditions.render_latent)

    def _as_velocity(
        self, output: Tensor, latent: Tensor, level: Tensor, render_latent: Tensor | None
    ) -> Float[Tensor, "b c t h w"]:
        if self.config.prediction_type == "velocity":
            return output
        clean = output if render_latent is None else render_latent + output
        return velocity_from_clean(latent, clean, level[:, None, :, None, None].to(latent))
