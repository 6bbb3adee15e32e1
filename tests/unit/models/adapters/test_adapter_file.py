"""An adapter folder on a model: the tuned network again, or a refusal that leaves it alone."""

from pathlib import Path

import pytest
import torch
from oracles_models import randomised
from safetensors.torch import load_file, save_file

from diff4splat.errors import CheckpointError, ConfigError, FileFormatError
from diff4splat.models.adapters.adapter_file import put_adapter, write_adapter
from diff4splat.models.adapters.tuning import prepare_tuning
from diff4splat.models.blocks.streamed_block import stream_blocks
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.config.tuning import ADAPTER_FILE
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model, load_model, save_model, with_adapter, with_parts
from diff4splat.models.networks import PARTS
from diff4splat.models.video_dit.dit import VideoDiT


def dit() -> VideoDiT:
    torch.manual_seed(0)
    return randomised(VideoDiT(tiny_size()))


@torch.no_grad()
def output(network: VideoDiT) -> torch.Tensor:
    generator = torch.Generator().manual_seed(1)
    latent = torch.randn(1, 4, 2, 4, 4, generator=generator)
    camera = torch.randn(1, 6, 5, 32, 32, generator=generator)
    text = torch.randn(1, 3, tiny_size().text.width, generator=generator)
    return network(latent, torch.full((1, 2), 0.5), camera, text)


@pytest.fixture
def tuned(tmp_path: Path) -> tuple[Path, torch.Tensor]:
    """The folder of a network that learnt something, and its output."""
    network = dit()
    prepare_tuning(network, "lora", 3)
    with torch.no_grad():
        for name, value in network.named_parameters():
            if name in network.learning:
                value.normal_(0, 0.3, generator=torch.Generator().manual_seed(len(name)))
    write_adapter(network.state_dict(), tmp_path / "adapter")
    return tmp_path / "adapter", output(network)


@pytest.mark.parametrize("streams", [False, True])
def test_a_model_with_the_adapter_is_the_tuned_network(tuned, streams: bool) -> None:
    folder, want = tuned
    network = dit()
    if streams:
        network.requires_grad_(False)
        stream_blocks(network)
    assert not torch.allclose(output(network), want, atol=1e-3)
    put_adapter(network, folder)
    torch.testing.assert_close(output(network), want, rtol=1e-5, atol=1e-6)


def test_a_loaded_model_has_it_and_says_so(tuned, tmp_path: Path) -> None:
    folder, want = tuned
    networks = create_networks(tiny_size())
    networks.dit.load_state_dict(dit().state_dict())
    model = Model(config=tiny_size(), networks=networks, trained=frozenset(PARTS[:5]))
    save_model(model, tmp_path / "model")
    plain = load_model(tmp_path / "model", parts=())
    adapted = with_adapter(plain, folder)
    torch.testing.assert_close(output(with_parts(adapted, ("dit",)).networks.dit), want)
    assert adapted.weights_sha256(("dit",)) != plain.weights_sha256(("dit",))
    assert adapted.weights_sha256(("vae",)) == plain.weights_sha256(("vae",))
    with pytest.raises(ConfigError, match="not loaded yet"):
        with_adapter(with_parts(plain, ("dit",)), folder)


def changed(folder: Path, change) -> None:
    tensors = load_file(folder / ADAPTER_FILE)
    change(tensors)
    save_file(tensors, folder / ADAPTER_FILE)


FIRST = "blocks.0.attention.to_key.lora_down.weight"
DAMAGE = {
    "NaN": lambda tensors: tensors[FIRST].fill_(torch.nan),
    "unknown": lambda tensors: tensors.update({"blocks.9.a.lora_down.weight": torch.ones(3, 4)}),
    "another shape": lambda tensors: tensors.update({FIRST: torch.ones(3, 5)}),
    "one rank": lambda tensors: tensors.update({FIRST: torch.ones(2, 24)}),
    "missing": lambda tensors: tensors.pop(FIRST.replace("down", "up")),
    "other weights": lambda tensors: tensors.update({"head.weight": torch.ones(2)}),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_what_does_not_fit_is_refused(tuned, name: str) -> None:
    folder, _ = tuned
    changed(folder, DAMAGE[name])
    with pytest.raises(CheckpointError, match=name):
        put_adapter(dit(), folder)


def test_a_damaged_file_is_refused(tuned) -> None:
    folder, _ = tuned
    file = folder / ADAPTER_FILE
    file.write_bytes(file.read_bytes()[:-9])
    with pytest.raises(FileFormatError):
        put_adapter(dit(), folder)
