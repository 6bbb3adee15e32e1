"""From features of an image and a prompt to the pixels of what it asks to move (ours; ADR 29).

Axes: ``b`` images, ``r`` prompts of an image, ``h w`` pixels, ``c`` channels, ``q`` queries. Image
and prompt meet in a product of vectors, so one pass over an image serves many prompts:

    image ─ U-Net ─ features ─ embedding ───────┐
    prompt ─ text queries ──────────────────────┴ · ─ logits

The embedding of a pixel is linear in the features of its cell of two pixels, so queries are taken
through its weights instead, and vectors of pixels are never stored.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.captions.colors import COLOR_NAMES
from diff4splat.captions.vocabulary import NOUNS
from diff4splat.models.image_unet.cells import FOLDED_PX
from diff4splat.models.motion_unet.text_tokens import TextTokens, text_tokens
from diff4splat.models.object_mask.instance_head import InstanceHead
from diff4splat.models.object_mask.text_queries import TextQueries

TEXT_CHANNELS = 96
START_LOGIT = -3.0
"""Of a fresh network: few pixels are asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadShape:
    """Widths of an object mask."""

    width: int
    """Channels of the features of each encoder."""
    text_width: int
    instance_channels: int = 0
    """Of the vectors that separate instances; 0 without them."""


class MaskHeads(nn.Module):
    """The heads of an object mask; the networks that extend it give features."""

    def add_heads(self, shape: HeadShape, encoders: int = 1) -> None:
        """The last layers to be made."""
        width = shape.width
        self.embedding_width = 2 * width
        self.embedding = nn.Conv2d(encoders * width, self.embedding_width * FOLDED_PX**2, 1)
        self.names = nn.Conv2d(self.embedding_width, len(NOUNS) + len(COLOR_NAMES) + 2, 1)
        self.queries = TextQueries(shape.text_width, TEXT_CHANNELS, self.embedding_width)
        channels = shape.instance_channels
        self.instances = InstanceHead(encoders * width, channels) if channels else None

    def features(self, image: Float[Tensor, "b 3 h w"]) -> Float[Tensor, "b c h2 w2"]:
        """Of every cell of two pixels."""
        raise NotImplementedError

    def forward(
        self,
        image: Float[Tensor, "b 3 h w"],
        text: Float[Tensor, "b s e"],
        text_mask: Bool[Tensor, "b s"] | None = None,
    ) -> Float[Tensor, "b h w"]:
        """Logits of one prompt per image; ``image`` is RGB in [0, 1], its sides multiples of 16."""
        return self.logits(self.features(image), text_tokens(text, text_mask))[:, 0]

    def predict_mask_and_instances(
        self,
        image: Float[Tensor, "b 3 h w"],
        text: Float[Tensor, "b s e"],
        text_mask: Bool[Tensor, "b s"] | None = None,
    ) -> tuple[Float[Tensor, "b h w"], Float[Tensor, "b k h w"] | None]:
        """The logits, and vectors that separate instances (``instance_vectors``), if it has any."""
        features = self.features(image)
        logits = self.logits(features, text_tokens(text, text_mask))[:, 0]
        return logits, None if self.instances is None else self.instances(features)

    def name_logits(
        self, features: Float[Tensor, "b c h2 w2"]
    ) -> tuple[Float[Tensor, "b n h2 w2"], Float[Tensor, "b k h2 w2"]]:
        """Of the noun and colour of every cell's first pixel; the first of each is none of them.

        For training alone: vectors that tell names apart are easily asked for by name.
        """
        weight, bias = self._pixel_embedding()
        embedding = torch.nn.functional.conv2d(features, weight[:, 0, :, None, None], bias[:, 0])
        return self.names(embedding).split([len(NOUNS) + 1, len(COLOR_NAMES) + 1], 1)

    def logits(
        self, features: Float[Tensor, "b c h2 w2"], text: TextTokens
    ) -> Float[Tensor, "b r h w"]:
        """Of the prompts of every image; those of one image follow each other in ``text``."""
        queries, biases = self.queries(text)
        queries = queries.unflatten(0, (features.shape[0], -1)) / math.sqrt(self.embedding_width)
        biases = biases.unflatten(0, (features.shape[0], -1))
        weight, bias = self._pixel_embedding()
        of_features = torch.einsum("brqe,epc->brqpc", queries, weight)
        constant = torch.einsum("brqe,ep->brqp", queries, bias) + biases[..., None]
        found = torch.einsum("brqpc,bchw->brqphw", of_features, features)
        found = torch.logsumexp(found + constant[..., None, None], 2) + START_LOGIT
        return torch.nn.functional.pixel_shuffle(found, FOLDED_PX)[:, :, 0]

    def _pixel_embedding(self) -> tuple[Float[Tensor, "e p c"], Float[Tensor, "e p"]]:
        """Weight and bias of every pixel ``p`` of a cell."""
        shape = (self.embedding_width, FOLDED_PX**2)
        weight, bias = self.embedding.weight, self.embedding.bias
        return weight.unflatten(0, shape)[..., 0, 0], bias.unflatten(0, shape)
