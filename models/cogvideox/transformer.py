"""CogVideoX's video model behind the calls of ``VideoDiT``: it gives velocities at our levels.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns, ``f hh ww``
video frames and pixels, ``t2 h2 w2`` tokens, ``d`` width, ``s`` text tokens. Level 0 is data and 1
is noise, given per latent frame.

    latent / r ─ patches ─ linear ─┐
    render, camera ────────────────┤
    positions (2B, 5B-I2V) ────────┴ + ─┐
    text ─ linear ──────────────────────┴─ blocks ─ norm, norm, modulate ─ linear ─ v ─ velocity
    level ─ step ─ sinusoid, MLP ─ modulation ──┘

With two frames per token an odd number of latent frames gets the first one twice.
"""

import torch
from jaxtyping import Bool, Complex, Float
from torch import Tensor, nn

from diff4splat.models.blocks.initialise import zero_
from diff4splat.models.blocks.modulation import ZeroModulation, modulate
from diff4splat.models.blocks.time_embedding import EmbeddingMlp
from diff4splat.models.cogvideox.joint_block import NORM_EPSILON, JointBlock
from diff4splat.models.cogvideox.noise_schedule import path_norm, step_of_level, velocity_from_v
from diff4splat.models.cogvideox.positions import (
    Grid,
    added_positions,
    learned_positions,
    rotary_turns,
    step_embedding,
)
from diff4splat.models.cogvideox.token_frames import join_patches, merge_frames, repeat_first_frame
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import TOKEN_PATCH
from diff4splat.models.video_dit.camera_adapter import CameraAdapter
from diff4splat.models.video_dit.conditions import DitConditions, ImageCondition, RenderCondition
from diff4splat.models.video_dit.patch_tokens import (
    channel_tokens,
    latent_tokens,
    require_render_condition,
)
from diff4splat.models.video_dit.render_condition import RenderConditionEmbedding

OFFSET = 2.0
"""The constant that CogVideoX1.5-5B-I2V embeds."""


class JointVideoDiT(nn.Module):
    """Velocity of a noisy latent under camera, text and image conditions."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        dit, joint, channels = config.dit, config.joint, config.vae.latent_channels
        self.config, self.joint = dit, joint
        self.patch = (joint.patch_frames, TOKEN_PATCH, TOKEN_PATCH)
        volume = joint.patch_frames * TOKEN_PATCH**2
        self.patch_embedding = nn.Linear((channels + dit.condition_channels) * volume, dit.width)
        if dit.render_condition:
            self.condition_embedding = RenderConditionEmbedding(channels, dit.width)
        self.camera_adapter = CameraAdapter(dit.width, dit.camera_width, config.vae.space_stride)
        self.text_projection = nn.Linear(config.text.width, dit.width)
        if joint.positions == "learned":
            count = (
                dit.padded_text_tokens
                + joint.base_grid[0] * joint.base_grid[1] * (joint.base_grid[2])
            )
            self.register_buffer("positions", torch.zeros(1, count, dit.width))
        self.level_mlp = EmbeddingMlp(dit.width, joint.level_width)
        if joint.offset_width:
            self.offset_mlp = EmbeddingMlp(joint.offset_width, joint.level_width)
        blocks = [JointBlock(dit, joint.level_width) for _ in range(dit.blocks)]
        self.blocks = nn.ModuleList(blocks)
        self.norm_final = nn.LayerNorm(dit.width, eps=NORM_EPSILON)
        self.modulation_out = ZeroModulation(joint.level_width, dit.width, 2)
        self.norm_out = nn.LayerNorm(dit.width, eps=NORM_EPSILON)
        self.head = zero_(nn.Linear(dit.width, channels * volume))

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
        """Velocity in one call: ``prepare``, then ``velocity``."""
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

        The mask does not count: CogVideoX attends to the padding of prompts.

        Raises:
            ShapeError: a render condition is missing, or given to a model that takes none.
        """
        del text_mask
        require_render_condition(self.config.render_condition, condition)
        frames = self.joint.patch_frames
        render = None if condition is None else self.condition_embedding(condition)
        return DitConditions(
            camera=None if camera is None else merge_frames(self.camera_adapter(camera), frames),
            text=None if text is None else self._text_tokens(text),
            channel_tokens=None if image is None else self._channel_tokens(image),
            render_tokens=None if render is None else merge_frames(render, frames),
        )

    def _text_tokens(self, text: Float[Tensor, "b s e"]) -> Float[Tensor, "b s d"]:
        tokens = self.text_projection(text[:, : self.config.padded_text_tokens])
        if self.joint.positions != "learned":
            return tokens
        return tokens + self.positions[:, : tokens.shape[1]]

    def _channel_tokens(self, image: ImageCondition) -> Float[Tensor, "b t2 h2 w2 d"] | None:
        channels, others = image.channels, self.config.condition_channels
        whole = None if channels is None else repeat_first_frame(channels, self.joint.patch_frames)
        return channel_tokens(self.patch_embedding, whole, self.patch, others)

    def velocity(
        self,
        latent: Float[Tensor, "b c t h w"],
        level: Float[Tensor, "b t"],
        conditions: DitConditions,
    ) -> Float[Tensor, "b c t h w"]:
        """Velocity at a noise level per latent frame; the state may be wider than the weights."""
        wide = level[:, None, :, None, None].to(torch.promote_types(latent.dtype, torch.float32))
        scaled = (latent / path_norm(wide)).to(self.patch_embedding.weight.dtype)
        tokens = self._video_tokens(scaled, conditions)
        embedding = self._level_embedding(level)
        text = tokens.new_zeros(tokens.shape[0], 0, tokens.shape[-1])
        text = text if conditions.text is None else conditions.text
        v = self._blocks(text, tokens, embedding)[:, :, -latent.shape[2] :]
        return velocity_from_v(latent, v, wide).to(latent.dtype)

    def _video_tokens(
        self, scaled: Float[Tensor, "b c t h w"], conditions: DitConditions
    ) -> Float[Tensor, "b t2 h2 w2 d"]:
        whole, others = (
            repeat_first_frame(scaled, self.joint.patch_frames),
            self.config.condition_channels,
        )
        tokens = latent_tokens(self.patch_embedding, whole, self.patch, others)
        added = (conditions.channel_tokens, conditions.camera, conditions.render_tokens)
        for part in (*added, self._positions(tuple(tokens.shape[1:4]), tokens.device)):
            tokens = tokens if part is None else tokens + part.to(tokens.dtype)
        return tokens

    def _positions(self, grid: Grid, device: torch.device) -> Float[Tensor, "t h w d"] | None:
        if self.joint.positions == "rotary":
            return None
        if self.joint.positions == "sinusoidal":
            return added_positions(grid, self.config.width, self.joint, device)
        table = self.positions[0, self.config.padded_text_tokens :]
        return learned_positions(table, grid, self.joint.base_grid)

    def _level_embedding(self, level: Float[Tensor, "b t"]) -> Float[Tensor, "b t2 e"]:
        """A token of several frames has the level of the last of them."""
        frames = self.joint.patch_frames
        step = step_of_level(
            repeat_first_frame(level, frames, axis=1)[:, frames - 1 :: frames], self.joint
        )
        embedding = self.level_mlp(step_embedding(step, self.config.width))
        if not self.joint.offset_width:
            return embedding
        offset = torch.full_like(step[:1, :1], OFFSET)
        return embedding + self.offset_mlp(step_embedding(offset, self.joint.offset_width))

    def _blocks(
        self,
        text: Float[Tensor, "b s d"],
        tokens: Float[Tensor, "b t2 h2 w2 d"],
        embedding: Float[Tensor, "b t2 e"],
    ) -> Float[Tensor, "b c t h w"]:
        """What the network predicts, v."""
        sides, turns = tokens.shape[2:4], self._turns(text, tokens)
        video = tokens.flatten(2, 3)
        for block in self.blocks:
            text, video = block(text, video, embedding, turns, block is self.blocks[-1])
        shift, scale = self.modulation_out(embedding)[:, :, :, None].unbind(2)
        video = modulate(self.norm_out(self.norm_final(video)), shift, scale)
        return join_patches(self.head(video).unflatten(2, sides), self.patch)

    def _turns(self, text: Tensor, tokens: Tensor) -> Complex[Tensor, "n 1 p"] | None:
        if self.joint.positions == "sinusoidal":
            return None
        grid, head_width = tuple(tokens.shape[1:4]), self.config.width // self.config.heads
        return rotary_turns(grid, head_width, text.shape[1], self.joint, tokens.device)
