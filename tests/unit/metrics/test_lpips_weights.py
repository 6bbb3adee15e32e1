import pickle
from collections import OrderedDict
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError
from diff4splat.metrics.features.backbones import ALEXNET, VGG16
from diff4splat.metrics.features.gradient_pyramid import GradientPyramidFeatures
from diff4splat.metrics.features.load import load_features
from diff4splat.metrics.features.lpips_weights import expected_shapes
from diff4splat.metrics.features.protocol import PerceptualFeatures

Weights = dict[str, torch.Tensor]


@pytest.fixture(scope="module")
def state() -> Weights:
    """A full state as ``lpips.LPIPS(net="alex").state_dict()`` has it, with random numbers."""
    generator = torch.Generator().manual_seed(0)
    weights = {
        key: torch.rand(shape, generator=generator) / 100
        for key, shape in expected_shapes(ALEXNET).items()
    }
    weights["scaling_layer.shift"] = torch.tensor([-0.030, -0.088, -0.188]).reshape(1, 3, 1, 1)
    weights["scaling_layer.scale"] = torch.tensor([0.458, 0.448, 0.450]).reshape(1, 3, 1, 1)
    return weights


def heads_of(state: Weights) -> Weights:
    return {key: value for key, value in state.items() if key.startswith("lin")}


def torchvision_of(state: Weights) -> Weights:
    """net.slice2.3.weight → features.3.weight, and a classifier."""
    trunk = {
        "features." + ".".join(key.split(".")[2:]): value
        for key, value in state.items()
        if key.startswith("net.")
    }
    return trunk | {"classifier.1.weight": torch.zeros(2, 2)}


def test_the_names_are_the_published_ones() -> None:
    alex, vgg = expected_shapes(ALEXNET), expected_shapes(VGG16)
    assert alex["net.slice1.0.weight"] == (64, 3, 11, 11)
    assert alex["net.slice5.10.bias"] == (256,)
    assert alex["lin1.model.1.weight"] == (1, 192, 1, 1)
    assert len(alex) == 5 * 2 + 5
    assert vgg["net.slice2.5.weight"] == (128, 64, 3, 3)
    assert vgg["net.slice5.28.weight"] == (512, 512, 3, 3)
    assert vgg["lin4.model.1.weight"] == (1, 512, 1, 1)
    assert len(vgg) == 13 * 2 + 5


@pytest.mark.parametrize("kind", ["torch", "ordered", "safetensors", "newer", "halves"])
def test_every_layout_gives_the_same_distance(state: Weights, tmp_path: Path, kind: str) -> None:
    whole = tmp_path / "whole.pth"
    torch.save(state, whole)
    expected = load_features(f"alex:{whole}")
    spec = f"alex:{tmp_path / 'file.pth'}"
    if kind == "torch":
        torch.save(heads_of(state) | {k: v for k, v in state.items() if "net" in k}, spec[5:])
    elif kind == "ordered":
        torch.save(OrderedDict(state), spec[5:])
    elif kind == "safetensors":
        spec = f"alex:{tmp_path / 'file.safetensors'}"
        save_file(state, spec[5:])
    elif kind == "newer":
        doubled = {f"lins.{key[3:]}": value for key, value in heads_of(state).items()}
        torch.save(state | doubled, spec[5:])
    else:
        torch.save(torchvision_of(state), spec[5:])
        torch.save(heads_of(state), tmp_path / "heads.pth")
        spec += f",{tmp_path / 'heads.pth'}"
    features = load_features(spec)
    assert features.name == expected.name
    image, reference = torch.rand(2, 1, 3, 32, 32)
    assert torch.equal(features.distance(image, reference), expected.distance(image, reference))


def test_half_precision_weights_are_widened(state: Weights, tmp_path: Path) -> None:
    torch.save({key: value.half() for key, value in state.items()}, tmp_path / "half.pth")
    features = load_features(f"alex:{tmp_path / 'half.pth'}")
    assert features.distance(*torch.rand(2, 1, 3, 32, 32)).dtype == torch.float32


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"net.slice2.3.weight": None}, r"missing 1 \(net.slice2.3.weight\)"),
        ({"extra.weight": torch.zeros(1)}, r"unexpected 1 \(extra.weight\)"),
        ({"features.28.weight": torch.zeros(1)}, r"unexpected 1 \(features.28.weight\)"),
        (
            {"lin0.model.1.weight": torch.zeros(1, 63, 1, 1)},
            r"wrong shape of 1 \(lin0.model.1.weight \(1, 63, 1, 1\) instead of \(1, 64, 1, 1\)\)",
        ),
        ({"net.slice1.0.bias": torch.full((64,), torch.nan)}, r"not finite in 1 \(net.slice1.0.b"),
        ({"scaling_layer.shift": torch.zeros(1, 3, 1, 1)}, r"scaling_layer.shift of version 0.1"),
        ({"scaling_layer.scale": torch.ones(1)}, r"scaling_layer.scale of version 0.1"),
        ({"scaling_layer.other": torch.zeros(3)}, r"unexpected 1 \(scaling_layer.other\)"),
    ],
)
def test_weights_that_do_not_belong(
    state: Weights, tmp_path: Path, change: dict[str, torch.Tensor | None], message: str
) -> None:
    changed = {key: value for key, value in (state | change).items() if value is not None}
    torch.save(changed, tmp_path / "file.pth")
    with pytest.raises(CheckpointError, match=message) as caught:
        load_features(f"alex:{tmp_path / 'file.pth'}")
    assert "\n" not in str(caught.value)


def test_many_missing_names_are_shortened(state: Weights, tmp_path: Path) -> None:
    torch.save(heads_of(state), tmp_path / "heads.pth")
    with pytest.raises(CheckpointError, match=r"missing 10 \(net.slice1.0.weight, .*, …\)"):
        load_features(f"alex:{tmp_path / 'heads.pth'}")


def test_the_same_weight_in_both_files(state: Weights, tmp_path: Path) -> None:
    for name in ("one.pth", "two.pth"):
        torch.save(heads_of(state), tmp_path / name)
    with pytest.raises(CheckpointError, match=r"two\.pth: given by the other file too 5"):
        load_features(f"alex:{tmp_path / 'one.pth'},{tmp_path / 'two.pth'}")


class Dangerous:
    """A pickle that would run code."""

    def __reduce__(self):
        return (print, ("executed",))


@pytest.mark.parametrize("name", ["file.pth", "file.safetensors"])
def test_damaged_files(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / name
    for content in (b"", b"nonsense", pickle.dumps({"a": Dangerous()}, protocol=2)):
        file.write_bytes(content)
        with pytest.raises(FileFormatError, match="expected safetensors or a torch file"):
            load_features(f"vgg:{file}")
    assert not capsys.readouterr().out


@pytest.mark.parametrize("content", [[torch.zeros(1)], {"epoch": 3}, torch.zeros(2)])
def test_a_torch_file_of_something_else(tmp_path: Path, content: object) -> None:
    torch.save(content, tmp_path / "file.pth")
    with pytest.raises(FileFormatError, match="expected tensors by name, got"):
        load_features(f"vgg:{tmp_path / 'file.pth'}")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="expected a weight file, got none"):
        load_features(f"vgg:{tmp_path / 'none.pth'}")


@pytest.mark.parametrize("spec", ["", "vgg", "vgg:", "squeeze:/a", "vgg:/a,/b,/c", "alex:/a,"])
def test_specs_of_another_form(spec: str) -> None:
    with pytest.raises(ConfigError, match="expected vgg:FILE or alex:FILE, or two files") as caught:
        load_features(spec)
    assert repr(spec) in str(caught.value)


def test_without_weights_the_stand_in_says_that_it_is_one() -> None:
    features = load_features(None)
    assert isinstance(features, GradientPyramidFeatures)
    assert isinstance(features, PerceptualFeatures)
    assert features.name == "stand-in: gradient pyramid, not LPIPS"
