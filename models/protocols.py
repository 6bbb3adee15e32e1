"""What generation asks of each network, whatever runs it: PyTorch modules or ONNX graphs.

Axes as in the modules that are named.
"""

from collections.abc import Iterable, Iterator
from typing import Protocol, runtime_checkable

from torch import Tensor

from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.video_dit.conditions import DitConditions, RenderCondition
from diff4splat.models.video_vae.latent_distribution import LatentDistribution


@runtime_checkable
class PromptEncoder(Protocol):
    """As ``TextEncoder``."""

    def encode_prompt(self, text: str) -> Tensor:
        """States of one prompt."""


@runtime_checkable
class ImageStates(Protocol):
    """As ``ClipImageEncoder``."""

    def encode_image(self, image: Tensor) -> Tensor:
        """States of an image that a video model attends to."""


@runtime_checkable
class DepthPrior(Protocol):
    """As ``MonocularDepthNet``."""

    def __call__(self, image: Tensor) -> Tensor:
        """Raw ray distance of every pixel."""

    def predict_distance_and_uncertainty(self, image: Tensor) -> tuple[Tensor, Tensor | None]:
        """The same by every encoder, and the log uncertainty of log depth, if it has one."""


@runtime_checkable
class MotionPrior(Protocol):
    """As ``MotionUNet``."""

    def __call__(
        self,
        image: Tensor,
        noisy: Tensor,
        level: Tensor,
        text: Tensor | None = None,
        text_mask: Tensor | None = None,
        object_mask: Tensor | None = None,
    ) -> Tensor:
        """The clean motion."""

    def predict_motion_and_mask(
        self,
        image: Tensor,
        noisy: Tensor,
        level: Tensor,
        text: Tensor | None = None,
        text_mask: Tensor | None = None,
        object_mask: Tensor | None = None,
    ) -> tuple[Tensor, Tensor]:
        """The clean motion, and for every pixel the logit that it moves."""


@runtime_checkable
class ImageClasses(Protocol):
    """As ``ImageClassifier``."""

    def __call__(self, image: Tensor, mask_logits: Tensor, classes: Tensor) -> Tensor:
        """Logits of an object mask, corrected where prompts name classes."""


@runtime_checkable
class ImageCompletion(Protocol):
    """As ``ImageInpainting``."""

    multiple_px: int

    def __call__(self, image: Tensor, known: Tensor) -> Tensor:
        """The image where it is known, completed elsewhere."""


@runtime_checkable
class ObjectMask(Protocol):
    """As ``ObjectMaskNet``."""

    def __call__(self, image: Tensor, text: Tensor, text_mask: Tensor | None = None) -> Tensor:
        """For every pixel the logit that the prompt asks it to move."""

    def predict_mask_and_instances(
        self, image: Tensor, text: Tensor, text_mask: Tensor | None = None
    ) -> tuple[Tensor, Tensor | None]:
        """The logits, and vectors that separate instances, if it has any."""


@runtime_checkable
class ShadowOfObject(Protocol):
    """As ``ObjectShadowNet``."""

    def __call__(self, image: Tensor, mask: Tensor) -> Tensor:
        """For every pixel how much darker the object of the mask makes it."""


@runtime_checkable
class VideoCodec(Protocol):
    """As ``VideoVae``."""

    def encode(self, video: Tensor) -> LatentDistribution:
        """Standardised latents."""

    def decode(self, latent: Tensor) -> Tensor:
        """Video in about [−1, 1]."""


@runtime_checkable
class VideoVelocity(Protocol):
    """As ``VideoDiT``."""

    def prepare(
        self,
        camera: Tensor | None = None,
        text: Tensor | None = None,
        text_mask: Tensor | None = None,
        condition: RenderCondition | None = None,
    ) -> DitConditions:
        """Embed the conditions once for all steps of a sampler."""

    def velocity(self, latent: Tensor, level: Tensor, conditions: DitConditions) -> Tensor:
        """Velocity at a noise level per latent frame."""


@runtime_checkable
class GaussianMaps(Protocol):
    """As ``Ldrm``."""

    def __call__(
        self,
        latent: Tensor,
        camera: Tensor,
        posed_video: PosedVideo | None = None,
        *,
        moving: bool = True,
    ) -> RawGaussianMaps:
        """Raw maps of the video's frames."""


@runtime_checkable
class DeformationMaps(Protocol):
    """As ``DeformationNetwork``."""

    def is_identity(self) -> bool:
        """True where nothing can move."""

    def at_times(self, tokens: Tensor, times: Iterable[Tensor]) -> Iterator[Tensor]:
        """Raw deformation at one time after the other."""
