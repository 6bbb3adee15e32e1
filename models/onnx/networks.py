"""A folder of ONNX graphs as the networks of a model."""

from collections.abc import Collection
from pathlib import Path

from diff4splat.models.hub.weight_files import load_config
from diff4splat.models.networks import Networks
from diff4splat.models.onnx.adapters import (
    OnnxDeformation,
    OnnxDepth,
    OnnxDit,
    OnnxImageClassifier,
    OnnxImageInpainting,
    OnnxLdrm,
    OnnxMotion,
    OnnxObjectMask,
    OnnxObjectShadow,
    OnnxTextEncoder,
    OnnxVae,
)
from diff4splat.models.onnx.graph import OnnxModel

ADAPTERS = {
    "vae": OnnxVae,
    "text_encoder": OnnxTextEncoder,
    "dit": OnnxDit,
    "ldrm": OnnxLdrm,
    "deformation": OnnxDeformation,
    "monocular_depth": OnnxDepth,
    "motion_unet": OnnxMotion,
    "object_mask": OnnxObjectMask,
    "image_classifier": OnnxImageClassifier,
    "image_inpainting": OnnxImageInpainting,
    "object_shadow": OnnxObjectShadow,
}
FEW_THREADS = (
    *("text_encoder", "monocular_depth", "motion_unet", "object_mask", "image_classifier"),
    *("image_inpainting", "object_shadow"),
)
"""One thread: scenes without a video fill are the same, bit for bit, on any number of cores."""


def onnx_networks(folder: Path, parts: Collection[str]) -> Networks:
    """``parts`` of the model in ``folder``, every graph compared with the manifest.

    Raises:
        FileFormatError: a graph is absent, damaged, or not the one that was exported.
    """
    config = load_config(folder)
    one, many = OnnxModel(folder, threads=1), OnnxModel(folder)
    chosen = {}
    for part in parts:
        model = one if part in FEW_THREADS else many
        for entry in model.manifest.of_part(part):
            model[entry.name]
        chosen[part] = ADAPTERS[part](model, config)
    return Networks(**chosen)
