"""Work of ``diff4splat export onnx``: layers to trace and weights to write, on the meta device."""

from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise

if TYPE_CHECKING:
    from torch import nn

    from diff4splat.cli.export_onnx import ExportOnnx

NAME = "export onnx"


def request_work(command: "ExportOnnx") -> dict[str, float | int]:
    """Counted from the configuration: no weight is read, none is allocated."""
    from diff4splat.models.factory import create_networks
    from diff4splat.models.hub.folders import find_config
    from diff4splat.models.onnx_export.sources import graph_sources

    config = find_config(command.model)
    sources = graph_sources(create_networks(config, "meta"), config)
    layers = sum(layer_count(source.module) for source in sources)
    weights = sum(weight_count(source.module) for source in sources)
    stored = not command.shapes_only
    return {
        "traced_layers": layers,
        "optimized_layers": layers * stored,
        "stored_weights": weights * stored,
        "checked_layers": layers * (stored and not command.skip_parity),
        "converted_weights": weights * (stored and command.precision != "float32"),
    }


def layer_count(module: "nn.Module") -> int:
    """Modules that hold no other."""
    return sum(1 for one in module.modules() if not any(one.children()))


def weight_count(module: "nn.Module") -> int:
    """Numbers that a network has learnt."""
    return sum(one.numel() for one in module.parameters())


def promise(command: "ExportOnnx") -> Promise | None:
    """What the export is expected to need; None where no export was measured."""
    return Costing.of().plain_promise(NAME, request_work(command))
