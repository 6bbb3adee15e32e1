"""Weights in eight bits."""

from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.eight_bit import SCALE, from_eight_bits, to_eight_bits
from diff4splat.models.hub.export import export_model
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.models.hub.weights import load_networks, save_networks


def weight(scale: float, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return scale * torch.randn(64, 16, 3, 3, generator=generator)


@given(exponent=st.integers(-9, 9), seed=st.integers(0, 99))
def test_a_weight_is_off_by_half_a_step_at_most(exponent: int, seed: int) -> None:
    given_weight = weight(10.0**exponent, seed)
    again = from_eight_bits(to_eight_bits({"w": given_weight}))["w"]
    step = given_weight.flatten(1).abs().amax(1) / 127
    error = (again - given_weight).flatten(1).abs().amax(1)
    assert bool((error <= 0.5001 * step).all())


def test_small_tensors_and_vectors_keep_half_precision() -> None:
    tensors = {"bias": torch.randn(9999), "small": torch.randn(4, 4)}
    stored = to_eight_bits(tensors)
    assert set(stored) == set(tensors)
    assert {value.dtype for value in stored.values()} == {torch.float16}


def test_channels_of_zeros_stay_zero() -> None:
    zeros = weight(1.0)
    zeros[3] = 0
    again = from_eight_bits(to_eight_bits({"w": zeros}))["w"]
    assert not again[3].any()
    assert bool(again.isfinite().all())


@pytest.mark.parametrize("scale", [None, torch.ones(3)])
def test_a_weight_without_its_scale_is_refused(scale: torch.Tensor | None) -> None:
    stored = to_eight_bits({"w": weight(1.0)})
    stored.pop("w" + SCALE)
    if scale is not None:
        stored["w" + SCALE] = scale
    with pytest.raises(FileFormatError, match=r"w\.scale: expected a scale for 64 channels"):
        from_eight_bits(stored)


def test_a_part_takes_half_the_room_and_loads(tmp_path: Path) -> None:
    config = load_model("test").config
    networks = create_networks(config, seed=3)
    for folder, parts in (("half", ()), ("eight", ("dit",))):
        save_networks(networks, config, tmp_path / folder, torch.float16, eight_bit=parts)
    sizes = [(tmp_path / one / "dit.safetensors").stat().st_size for one in ("half", "eight")]
    assert sizes[1] < 0.7 * sizes[0]
    again = load_networks(tmp_path / "eight", config).dit.state_dict()
    for name, value in networks.dit.state_dict().items():
        step = float(value.abs().max()) / 127
        torch.testing.assert_close(again[name], value, rtol=0, atol=step)


def test_weights_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    config = load_model("test").config
    networks = create_networks(config)
    next(p for p in networks.dit.parameters() if p.numel() >= 4096).data.flatten()[0] = torch.nan
    with pytest.raises(CheckpointError, match="expected finite numbers"):
        save_networks(networks, config, tmp_path, torch.float16, eight_bit=("dit",))


def test_parts_that_are_not_exported_are_refused(packed_source: Model, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="eight bits: expected parts that are exported"):
        export_model(
            packed_source,
            tmp_path / "out",
            license="MIT",
            origin="a test",
            parts=("vae",),
            eight_bit=("dit",),
        )


@pytest.fixture
def packed_source(tmp_path: Path) -> Model:
    config = load_model("test").config
    networks = create_networks(config)
    save_model(Model(config=config, networks=networks, trained=frozenset({"vae"})), tmp_path / "m")
    return load_model(tmp_path / "m")
