"""All graphs of a model."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from torch import nn

from diff4splat.models.config.model import ModelConfig
from diff4splat.models.networks import Networks
from diff4splat.models.onnx_export.gaussian_graphs import deformation_graphs, ldrm_graphs
from diff4splat.models.onnx_export.prior_graphs import (
    image_classifier_graphs,
    image_inpainting_graphs,
    monocular_depth_graphs,
    motion_unet_graphs,
    object_mask_graphs,
    object_shadow_graphs,
    text_encoder_graphs,
)
from diff4splat.models.onnx_export.source import GraphSource
from diff4splat.models.onnx_export.video_graphs import dit_graphs, vae_graphs

GRAPHS: Mapping[str, Callable[[nn.Module, ModelConfig], list[GraphSource]]] = MappingProxyType(
    {
        "vae": vae_graphs,
        "text_encoder": text_encoder_graphs,
        "dit": dit_graphs,
        "ldrm": ldrm_graphs,
        "deformation": deformation_graphs,
        "monocular_depth": monocular_depth_graphs,
        "motion_unet": motion_unet_graphs,
        "object_mask": object_mask_graphs,
        "image_classifier": image_classifier_graphs,
        "image_inpainting": image_inpainting_graphs,
        "object_shadow": object_shadow_graphs,
    }
)
"""Part → its graphs."""


def graph_sources(networks: Networks, config: ModelConfig) -> list[GraphSource]:
    """The graphs of all parts that are loaded."""
    return [graph for part, network in networks.parts() for graph in GRAPHS[part](network, config)]
