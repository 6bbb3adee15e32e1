"""The shipped networks with rounded weights, at other sizes, and in chunks."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from functools import partial

import torch
from torch import Tensor, nn

from diff4splat.error_time.network_knobs import FILL_PARTS
from diff4splat.error_time.subjects import scenes
from diff4splat.error_time.subjects.inputs import Inputs
from diff4splat.error_time.subjects.model import request, shipped_model
from diff4splat.generation.inputs.input_image import downsample
from diff4splat.generation.inputs.request import Request
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.onnx_export.precision import LEAST_ELEMENTS, quantized
from diff4splat.progress.run_log import RunLog

MULTIPLYING = (nn.Linear, nn.Conv2d, nn.Conv3d)


@torch.no_grad()
def scenes_in_precision(part: str, precision: str, inputs: Inputs) -> scenes.Scenes:
    """Scenes with one network's weights rounded, or with its products in that precision."""
    model = shipped_model()
    network = deepcopy(getattr(model.networks, part))
    name, _, computed = precision.partition(" ")
    if computed:
        compute_in(network, name)
    else:
        for weight in network.parameters():
            weight.copy_(rounded(weight, name))
    changed = replace(model, networks=replace(model.networks, **{part: network}))
    fill = "video" if part in FILL_PARTS else None
    return scenes.generate(changed, GenerationSettings(fill=fill), inputs)


def rounded(weight: Tensor, precision: str) -> Tensor:
    """``weight`` as it is stored in a precision, in float32 again; small int8 ones stay."""
    if precision == "int8":
        if weight.numel() < LEAST_ELEMENTS or weight.ndim < 2:
            return weight
        whole, scale = quantized(weight.numpy(), 0)
        return torch.from_numpy(whole).float() * torch.from_numpy(scale).reshape(
            -1, *[1] * (weight.ndim - 1)
        )
    return weight.to(getattr(torch, precision)).float()


def compute_in(network: nn.Module, precision: str) -> None:
    """Let the layers of ``network`` that multiply matrices do it in ``precision``."""
    for layer in [one for one in network.modules() if type(one) in MULTIPLYING]:
        if precision == "int8":
            if type(layer) is nn.Linear:
                layer.forward = _int8_linear(layer)
            continue
        layer.to(getattr(torch, precision))
        layer.forward = partial(_cast, layer.forward, getattr(torch, precision))


def _cast(forward: Callable[[Tensor], Tensor], dtype: torch.dtype, values: Tensor) -> Tensor:
    return forward(values.to(dtype)).to(values.dtype)


def _int8_linear(layer: nn.Linear) -> Callable[[Tensor], Tensor]:
    """Products of whole numbers from -127 to 127, one scale per token and per output.

    Float32 holds the products and nearly all sums exactly: the error is that of int8, the time not.
    """
    weight, weight_scale = _whole(layer.weight)

    def forward(values: Tensor) -> Tensor:
        whole, scale = _whole(values)
        product = torch.nn.functional.linear(whole, weight) * scale * weight_scale[:, 0]
        return product if layer.bias is None else product + layer.bias

    return forward


def _whole(values: Tensor) -> tuple[Tensor, Tensor]:
    """Whole numbers, and the scale of each row of the last axis."""
    scale = values.abs().amax(-1, keepdim=True).clamp_min(1e-30) / 127
    return (values / scale).round(), scale


def scenes_at_factor(factor: int, inputs: Inputs) -> scenes.Scenes:
    """Scenes of networks that see a copy reduced by ``factor``."""
    pipeline = Diff4SplatPipeline(shipped_model())
    return [pipeline.generate(_reduced(request(index), factor), RunLog()) for index in inputs]


def _reduced(asked: Request, factor: int) -> Request:
    small = downsample(asked.image, factor)
    path = asked.small_path
    cameras = path.cameras.resized(small.camera.size_px)
    return replace(asked, small=small, small_path=replace(path, cameras=cameras))


@torch.no_grad()
def decoded_in_chunks(frames: int, inputs: Inputs) -> Tensor:
    """Sixteen latent frames of noise, decoded ``frames`` at a time."""
    vae = shipped_model().networks.vae
    generator = torch.Generator().manual_seed(len(inputs))
    latent = torch.randn(1, vae.config.latent_channels, 16, 8, 8, generator=generator)
    caches, decoded = vae.initial_caches(latent), []
    for chunk in latent.split(frames, 2):
        made, caches = vae.decode_chunk(chunk, caches)
        decoded.append(made)
    return torch.cat(decoded, 2)
