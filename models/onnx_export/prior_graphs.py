"""Graphs of the text encoder and the networks that take one image and no video."""

from torch import Tensor, nn

from diff4splat.captions.image_classes.class_nouns import CLASSES
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.config.networks import MOTION_CELL_PX
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.models.image_unet.cells import MULTIPLE_PX as IMAGE_MULTIPLE_PX
from diff4splat.models.motion_unet.unet import MULTIPLE_PX as MOTION_MULTIPLE_PX
from diff4splat.models.onnx_export.source import (
    GraphSource,
    TensorFunction,
    integers,
    mask,
    normal,
    output,
    unit,
)
from diff4splat.models.text_encoder.prompt import VOCABULARY


def text_encoder_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """Tokens of prompts to states."""
    return [
        GraphSource(
            name="text_encoder",
            part="text_encoder",
            module=TensorFunction(network, lambda encoder, *inputs: (encoder(*inputs),)),
            inputs=(
                integers("tokens", VOCABULARY, "batch", "tokens"),
                mask("mask", "batch", "tokens"),
            ),
            outputs=(output("states", "batch", "tokens", config.text.width),),
        )
    ]


def monocular_depth_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """An image to the raw ray distance of its pixels.

    With two encoders also by each of them; ``log_uncertainty`` where the model has it.
    """
    on_backbone = config.monocular_depth.image_backbone
    size = _image_size(BACKBONE_MULTIPLE_PX if on_backbone else IMAGE_MULTIPLE_PX)
    outputs = [output("raw_distance", "batch", 1, *size)]
    if on_backbone:
        outputs.append(output("per_encoder", "batch", 2, *size))
    if config.monocular_depth.uncertainty:
        outputs.append(output("log_uncertainty", "batch", 1, *size))
    return [
        GraphSource(
            name="monocular_depth",
            part="monocular_depth",
            module=TensorFunction(network, _distances),
            inputs=(unit("image", "batch", 3, *size),),
            outputs=tuple(outputs),
        )
    ]


def motion_unet_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """An image, noisy motion and text to clean motion and to the logits of the motion mask.

    Where the model is shown the mask of an object, it is an input, and zeros are none.
    """
    size = (f"{MOTION_MULTIPLE_PX}*rows", f"{MOTION_MULTIPLE_PX}*columns")
    side = MOTION_MULTIPLE_PX // MOTION_CELL_PX
    motion = ("batch", 3, "frames", f"{side}*rows", f"{side}*columns")
    shown = (unit("object_mask", "batch", *size),) if config.motion_unet.object_mask else ()
    return [
        GraphSource(
            name="motion_unet",
            part="motion_unet",
            module=TensorFunction(network, _motion_and_mask),
            inputs=(
                unit("image", "batch", 3, *size),
                normal("noisy", *motion),
                unit("level", "batch"),
                normal("text", "batch", "tokens", config.text.width),
                mask("text_mask", "batch", "tokens"),
                *shown,
            ),
            outputs=(output("motion", *motion), output("mask_logits", "batch", *size)),
        )
    ]


def object_mask_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """An image, enlarged as in ``object_mask.enlarged``, and text to logits of what is to move.

    Where the model separates instances, ``instances`` are vectors and log scales of all pixels.
    """
    size = _image_size(IMAGE_MULTIPLE_PX)
    outputs = [output("mask_logits", "batch", *size)]
    channels = config.object_mask.instance_channels
    if channels:
        outputs.append(output("instances", "batch", channels + 1, *size))
    return [
        GraphSource(
            name="object_mask",
            part="object_mask",
            module=TensorFunction(network, _mask_and_instances),
            inputs=(
                unit("image", "batch", 3, *size),
                normal("text", "batch", "tokens", config.text.width),
                mask("text_mask", "batch", "tokens"),
            ),
            outputs=tuple(outputs),
        )
    ]


def image_classifier_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """An image, logits of the object mask and classes of prompts to corrected logits."""
    del config
    size = _image_size(IMAGE_MULTIPLE_PX)
    return [
        GraphSource(
            name="image_classifier",
            part="image_classifier",
            module=TensorFunction(network, lambda part, *inputs: (part(*inputs),)),
            inputs=(
                unit("image", "batch", 3, *size),
                normal("mask_logits", "batch", "prompts", *size),
                mask("classes", "batch", "prompts", CLASSES),
            ),
            outputs=(output("corrected_logits", "batch", "prompts", *size),),
        )
    ]


def image_inpainting_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """An image, and where it is known, to the completed image."""
    size = _image_size(config.image_inpainting.multiple_px)
    return [
        GraphSource(
            name="image_inpainting",
            part="image_inpainting",
            module=TensorFunction(network, lambda part, *inputs: (part(*inputs),)),
            inputs=(unit("image", "batch", 3, *size), mask("known", "batch", *size)),
            outputs=(output("completed", "batch", 3, *size),),
            sizes=(("rows", 2), ("columns", 3)),  # Of many pixels each.
        )
    ]


def object_shadow_graphs(network: nn.Module, config: ModelConfig) -> list[GraphSource]:
    """An image and the mask of an object to how much darker it makes each pixel."""
    del config
    size = _image_size(IMAGE_MULTIPLE_PX)
    return [
        GraphSource(
            name="object_shadow",
            part="object_shadow",
            module=TensorFunction(network, lambda part, *inputs: (part(*inputs),)),
            inputs=(unit("image", "batch", 3, *size), unit("mask", "batch", *size)),
            outputs=(output("darkening", "batch", 3, *size),),
        )
    ]


def _image_size(multiple_px: int) -> tuple[str, str]:
    """Symbols of the sides that a network takes."""
    return f"{multiple_px}*rows", f"{multiple_px}*columns"


def _distances(network: nn.Module, image: Tensor) -> tuple[Tensor, ...]:
    per_encoder, uncertainty = network.predict_distance_and_uncertainty(image)
    if per_encoder.shape[1] == 1:
        return (per_encoder,)
    found = (per_encoder.mean(1, keepdim=True), per_encoder, uncertainty)
    return tuple(one for one in found if one is not None)


def _mask_and_instances(network: nn.Module, *inputs: Tensor) -> tuple[Tensor, ...]:
    found = network.predict_mask_and_instances(*inputs)
    return tuple(one for one in found if one is not None)


def _motion_and_mask(network: nn.Module, *inputs: Tensor) -> tuple[Tensor, Tensor]:
    return network.predict_motion_and_mask(*inputs)
