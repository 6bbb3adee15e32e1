"""Tiny random networks of transformers, exported in the public layout: the same depth as theirs."""

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small_onnx
import torch
from torch import Tensor, nn

from diff4splat.models.depth_priors.onnx_prior import OnnxDepthPrior
from diff4splat.models.depth_priors.preprocessing import network_input

transformers = pytest.importorskip("transformers", reason="transformers is not installed")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore"),
]
RGB = torch.rand(60, 84, 3, generator=torch.Generator().manual_seed(0))


class Outputs(nn.Module):
    """A network whose outputs are a tuple, as graphs have them."""

    def __init__(self, network: nn.Module, names: Sequence[str]) -> None:
        super().__init__()
        self.network, self.names = network, names

    def forward(self, pixel_values: Tensor) -> tuple[Tensor, ...]:
        found = self.network(pixel_values)
        return tuple(getattr(found, name) for name in self.names)


def exported(
    network: nn.Module, file: Path, size: tuple[int, int], names: Sequence[str]
) -> OnnxDepthPrior:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            Outputs(network, names).eval(), (torch.rand(1, 3, *size),), str(file), dynamo=False,
            input_names=["pixel_values"], output_names=list(names), opset_version=17,
        )  # fmt: skip
    return OnnxDepthPrior(file)


def depth_anything() -> nn.Module:
    backbone = transformers.Dinov2Config(
        hidden_size=16, num_hidden_layers=2, num_attention_heads=2, intermediate_size=32,
        image_size=56, patch_size=14, out_indices=[1, 2], reshape_hidden_states=False,
    )  # fmt: skip
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone, reassemble_hidden_size=16, patch_size=14,
        reassemble_factors=[1, 0.5], neck_hidden_sizes=[8, 8], fusion_hidden_size=8,
        head_hidden_size=8,
    )  # fmt: skip
    return transformers.DepthAnythingForDepthEstimation(config)


def dpt() -> nn.Module:
    config = transformers.DPTConfig(
        hidden_size=16, num_hidden_layers=4, num_attention_heads=2, intermediate_size=32,
        image_size=64, patch_size=16, backbone_out_indices=[0, 1, 2, 3],
        neck_hidden_sizes=[8, 8, 8, 8], fusion_hidden_size=8, is_hybrid=False,
        use_auxiliary_head=False,
    )  # fmt: skip
    return transformers.DPTForDepthEstimation(config)


def scaled_up(network: nn.Module) -> nn.Module:
    """Fresh weights give depth near 0; larger ones make errors show."""
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.2 * torch.randn(parameter.shape, generator=generator))
    return network.eval()


@pytest.mark.parametrize(
    ("make", "family", "size"),
    [(depth_anything, "Depth Anything", (56, 70)), (dpt, "DPT", (64, 64))],
)
def test_the_same_inverse_depth(
    make: Callable[[], nn.Module], family: str, size: tuple[int, int], tmp_path: Path
) -> None:
    network = scaled_up(make())
    prior = exported(network, tmp_path / "a.onnx", size, ["predicted_depth"])
    assert (prior.contract.family, prior.kind) == (family, "inverse")
    found = prior.predict(RGB, (84.0, 84.0))
    pixels = network_input(prior.contract, prior.image, RGB)
    with torch.no_grad():
        expected = network(pixels).predicted_depth[0].numpy()
    error = np.abs(found.values - expected).max() / np.abs(expected).max()
    assert expected.std() > 0 and error < 1e-4


def test_the_image_is_prepared_as_transformers_does(tmp_path: Path) -> None:
    """Theirs resizes 8-bit pixels; ours differs by their rounding."""
    processor = _processor()
    prior = OnnxDepthPrior(small_onnx.one_map(tmp_path / "a.onnx"))
    y, x = torch.meshgrid(torch.linspace(0, 4, 60), torch.linspace(0, 6, 84), indexing="ij")
    image = (torch.stack([x.sin(), y.cos(), (x + y).sin()], -1) * 120 + 127).round().byte()
    theirs = processor(image.numpy(), return_tensors="pt")["pixel_values"]
    ours = network_input(prior.contract, prior.image, image.float() / 255)
    assert ours.shape == theirs.shape
    assert (ours - theirs).abs().max() < 4 / 255 / 0.224


def _processor() -> Any:
    try:
        from transformers.models.dpt.image_processing_pil_dpt import DPTImageProcessorPil

        return DPTImageProcessorPil(
            size={"height": 518, "width": 518}, keep_aspect_ratio=True, ensure_multiple_of=14,
            image_mean=[0.485, 0.456, 0.406], image_std=[0.229, 0.224, 0.225], do_resize=True,
            do_normalize=True, resample=3,
        )  # fmt: skip
    except ImportError as error:
        pytest.skip(f"this processor needs another package: {error}")


def depth_pro() -> nn.Module:
    backbone = {
        "model_type": "dinov2", "hidden_size": 16, "num_hidden_layers": 2,
        "num_attention_heads": 2, "intermediate_size": 32, "patch_size": 8, "image_size": 16,
    }  # fmt: skip
    config = transformers.DepthProConfig(
        fusion_hidden_size=8, patch_size=16, intermediate_hook_ids=[1, 0],
        intermediate_feature_dims=[8, 6], scaled_images_ratios=[0.5, 1.0],
        scaled_images_overlap_ratios=[0.0, 0.2], scaled_images_feature_dims=[12, 12],
        image_model_config=backbone, patch_model_config=backbone, fov_model_config=backbone,
        use_fov_model=True, num_fov_head_layers=0,
    )  # fmt: skip
    return transformers.DepthProForDepthEstimation(config)


def test_depth_pro_in_metres(tmp_path: Path) -> None:
    """Depth of its own post-processing, at the network's own size."""
    network = depth_pro().eval()
    names = ["predicted_depth", "field_of_view"]
    prior = exported(network, tmp_path / "a.onnx", (64, 64), names)
    assert (prior.contract.family, prior.kind) == ("Depth Pro", "metric")
    found = prior.predict(RGB, (84.0, 84.0))
    with torch.no_grad():
        outputs = network(network_input(prior.contract, prior.image, RGB))
    width = found.values.shape[1]
    focal = 0.5 * width / torch.tan(0.5 * torch.deg2rad(outputs.field_of_view[0]))
    canonical = outputs.predicted_depth[0] * width / focal
    expected = 1 / canonical.clamp(1e-4, 1e4)
    np.testing.assert_allclose(found.values, expected.numpy(), rtol=2e-3)
