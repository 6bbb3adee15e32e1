"""The networks that decide about motion, as one prior.

image, text ─ object mask ─ image classifier ─ what moves
image, noise, text, mask ─ motion U-Net ─ how
"""

from dataclasses import dataclass, replace

from jaxtyping import Float
from torch import Tensor

from diff4splat.captions.image_classes.class_nouns import class_rows
from diff4splat.models.networks import Networks
from diff4splat.models.object_mask.enlarged import enlarged, reduced
from diff4splat.models.protocols import ImageClasses, MotionPrior, ObjectMask

LEAST_PROBABILITY = 0.4
"""Of the most probable pixel; below it nothing moves: the object is not there (chosen on validation
worlds: docs/log/unknown-nouns.md)."""
LEAST_SHARE = 0.85
"""Of the highest probability; components below it are other objects, and stay (chosen on
validation worlds: docs/log/object-mask.md)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectMaps:
    """What an object mask says of an image and a text."""

    logits: Float[Tensor, "b h w"]
    """That the text asks a pixel to move."""
    instances: Float[Tensor, "b k h w"] | None = None
    """Vectors that separate instances (``models.object_mask.instance_vectors``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskedMotion:
    """A motion prior, and an object mask that goes before its own mask."""

    motion_unet: MotionPrior
    object_mask: ObjectMask
    image_classifier: ImageClasses | None = None

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
        return self.motion_unet(image, noisy, level, text, text_mask, object_mask)

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
        given = (image, noisy, level, text, text_mask, object_mask)
        return self.motion_unet.predict_motion_and_mask(*given)

    def object_maps(self, image: Tensor, text: Tensor, classes: tuple[int, ...] = ()) -> ObjectMaps:
        """What the text asks to move, as a mean with the mirror image, and vectors of instances.

        Sides in a text are those of motion, so its object is the same in both. ``classes`` are
        those of its nouns (``captions.image_classes``).
        """
        larger, size_px = enlarged(image), image.shape[-2:]
        logits, instances = self.object_mask.predict_mask_and_instances(larger, text)
        mirrored = self.object_mask(larger.flip(-1), text).flip(-1)
        maps = ObjectMaps(
            logits=reduced((logits + mirrored)[:, None] / 2, size_px)[:, 0],
            instances=None if instances is None else reduced(instances, size_px),
        )
        return self._corrected(image, maps, classes) if classes else maps

    def _corrected(self, image: Tensor, maps: ObjectMaps, classes: tuple[int, ...]) -> ObjectMaps:
        """By the image classifier, if there is one."""
        if self.image_classifier is None:
            return maps
        rows = class_rows([classes]).to(image.device)[None]
        logits = self.image_classifier(image, maps.logits[:, None], rows)[:, 0]
        return replace(maps, logits=logits)


def motion_prior(networks: Networks) -> MotionPrior | None:
    """The motion prior of a model; None if it has none, or none is loaded."""
    motion, mask = networks.motion_unet, networks.object_mask
    if motion is None or mask is None:
        return motion
    return MaskedMotion(
        motion_unet=motion, object_mask=mask, image_classifier=networks.image_classifier
    )
