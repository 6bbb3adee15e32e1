"""The trained networks in float32, bfloat16 and float16 against float64, one by one."""

import copy
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial

import torch
from torch import Tensor, nn

from diff4splat.models.hub.model import Model, load_model
from diff4splat.models.onnx_export.source import GraphSource
from diff4splat.models.onnx_export.sources import graph_sources
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import all_finite, relative_error, weighted_sum
from diff4splat.stability.subjects.casting import DTYPES, camera_dtype, cast

GROUP = "networks"
LIMITS = {"float32": 1e-4, "bfloat16": 0.1, "float16": 0.02}
"""float32 has 24 bits, bfloat16 8 and float16 11; networks of tens of layers lose a few more."""
FLOAT32_ALONE = ("image_inpainting",)
"""Networks that run outside of autocast, in float32 whatever precision is asked for."""
CAMERA_INPUTS = ("focal_px", "center_px", "world_from_camera")


def network_checks(name_or_folder: str) -> Iterator[Check]:
    """One check per graph and precision."""
    for source in sources(name_or_folder):
        for dtype, limit in LIMITS.items():
            if source.part in FLOAT32_ALONE and dtype != "float32":
                continue
            yield Check(
                group=GROUP,
                name=f"{source.name}, {dtype}",
                run=partial(measure_network, source, DTYPES[dtype]),
                limit=limit,
                error_unit="largest difference over largest value",
                quick=source.name in ("monocular_depth", "motion_unet", "dit_velocity"),
            )


@cache
def model_of(name_or_folder: str) -> Model:
    """With all networks, loaded once."""
    return load_model(name_or_folder)


@cache
def sources(name_or_folder: str) -> tuple[GraphSource, ...]:
    """Every network as functions of tensors, with inputs of the ranges that it was made for."""
    model = model_of(name_or_folder)
    return tuple(graph_sources(model.networks, model.config))


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Outputs of one network, and whether the gradients of its weights and inputs are finite."""

    outputs: tuple[Tensor, ...]
    gradient_finite: bool | None


def measure_network(source: GraphSource, dtype: torch.dtype) -> Outcome:
    """The largest error of any output."""
    exact = _exact(source)
    got = evaluate(source, dtype, gradient=True)
    pairs = zip(got.outputs, exact.outputs, strict=True)
    errors = {
        spec.name: relative_error(output, want)
        for spec, (output, want) in zip(source.outputs, pairs, strict=True)
    }
    worst = max(errors, key=errors.__getitem__)
    return Outcome(
        error=errors[worst],
        value_finite=all_finite(got.outputs),
        gradient_finite=got.gradient_finite,
        note=f"worst output: {worst}" if len(errors) > 1 and math.isfinite(errors[worst]) else "",
    )


def evaluate(source: GraphSource, dtype: torch.dtype, gradient: bool = False) -> Evaluation:
    """The network once, all of it in ``dtype``."""
    module = copy.deepcopy(source.module).to(dtype).eval()
    examples = source.examples(source.traced_sizes(), seed=1)
    inputs = [
        cast(value, camera_dtype(dtype) if entry.spec.name in CAMERA_INPUTS else dtype)
        for entry, value in zip(source.inputs, examples, strict=True)
    ]
    leaves = [tensor.requires_grad_() for tensor in inputs if tensor.is_floating_point()]
    with torch.set_grad_enabled(gradient):
        outputs = module(*inputs)
    finite = _gradient_finite(module, leaves, outputs) if gradient else None
    return Evaluation(outputs=tuple(out.detach() for out in outputs), gradient_finite=finite)


@cache
def _exact(source_of: GraphSource) -> Evaluation:
    return evaluate(source_of, torch.float64)


def _gradient_finite(
    module: nn.Module, leaves: list[Tensor], outputs: tuple[Tensor, ...]
) -> bool | None:
    """Of all weights and inputs; None where nothing has a gradient."""
    leaves = [*leaves, *module.parameters()]
    outputs = [output for output in outputs if output.requires_grad]
    if not outputs:
        return None
    gradients = torch.autograd.grad(weighted_sum(outputs), leaves, allow_unused=True)
    return all_finite(gradient for gradient in gradients if gradient is not None)
