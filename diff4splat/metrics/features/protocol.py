"""What features of images, videos and text are, so that tables need not know which ones they are.

Axes: ``n`` images or videos, ``t`` frames, ``h w`` pixels, ``d`` features. RGB in [0, 1].
"""

from typing import Protocol, runtime_checkable

from jaxtyping import Float
from torch import Tensor


@runtime_checkable
class PerceptualFeatures(Protocol):
    """A distance between images that should agree with people's judgement."""

    @property
    def name(self) -> str:
        """For tables: which network and weights, or that it is a stand-in."""
        ...

    def distance(
        self, image: Float[Tensor, "n 3 h w"], reference: Float[Tensor, "n 3 h w"]
    ) -> Float[Tensor, " n"]:
        """0 for equal images, more for worse ones; differentiable, float32 or better."""
        ...


@runtime_checkable
class VideoFeatures(Protocol):
    """One vector per video, for distances of distributions (FVD and KVD with I3D)."""

    @property
    def name(self) -> str:
        """For tables: which network and weights."""
        ...

    def embed_videos(self, videos: Float[Tensor, "n t 3 h w"]) -> Float[Tensor, "n d"]:
        """Features of each video; no gradients needed."""
        ...


@runtime_checkable
class ImageFeatures(Protocol):
    """One vector per image, for the consistency of frames (VBench with DINO or CLIP)."""

    @property
    def name(self) -> str:
        """For tables: which network and weights."""
        ...

    def embed_images(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n d"]:
        """Features of each image; no gradients needed."""
        ...


@runtime_checkable
class TextImageFeatures(ImageFeatures, Protocol):
    """Images and sentences in one space, for the CLIP score."""

    def embed_texts(self, texts: list[str]) -> Float[Tensor, "n d"]:
        """Features of each sentence."""
        ...
