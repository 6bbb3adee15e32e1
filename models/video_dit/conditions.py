"""Conditions of the video model, before and after they are embedded.

Axes: ``b`` batch, ``c`` latent channels, ``t h w`` latent frames, rows and columns, ``f hh ww``
video frames and pixels, ``h2 w2`` tokens, ``d`` width, ``s`` text tokens.
"""

from dataclasses import dataclass, replace

from jaxtyping import Bool, Float
from torch import Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderCondition:
    """A rendered video as the transformer takes it."""

    latent: Float[Tensor, "b c t h w"]
    """Standardised."""
    validity: Float[Tensor, "b 1 f hh ww"]
    """1 where the pixel is visible in the input image, 0 where it is hidden."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageCondition:
    """The first frame as image-to-video weights take it."""

    channels: Float[Tensor, "b c2 t h w"] | None = None
    """Wan: mask of known frames, then the latent of the image followed by grey frames. CogVideoX:
    the latent of the image, followed by zeros. Frames before the video belong to its first token.
    """
    states: Float[Tensor, "b i e"] | None = None
    """Of an image encoder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DitConditions:
    """Embedded conditions, the same at all noise levels of a generation; None is skipped."""

    camera: Float[Tensor, "b t h2 w2 d"] | None = None
    text: Float[Tensor, "b s d"] | None = None
    text_mask: Bool[Tensor, "b s"] | Float[Tensor, "b s"] | None = None
    """True where a text token is real; None when all are. Numbers are added to the logits."""
    image: Float[Tensor, "b i d"] | None = None
    """States of the image that every block attends to."""
    channel_tokens: Float[Tensor, "b t h2 w2 d"] | None = None
    """What the channels beside the noisy ones add to every token."""
    pooled_text: Float[Tensor, "b d"] | None = None
    """Added to the embedding of the level."""
    render_latent: Float[Tensor, "b c t h w"] | None = None
    """Latent of the render condition, which clean predictions correct."""
    render_tokens: Float[Tensor, "b t h2 w2 d"] | None = None

    def with_text_of(self, other: "DitConditions | None") -> "DitConditions":
        """The same with the text of others, or without text; all else is held once."""
        return replace(
            self,
            text=None if other is None else other.text,
            text_mask=None if other is None else other.text_mask,
            pooled_text=None if other is None else other.pooled_text,
        )
