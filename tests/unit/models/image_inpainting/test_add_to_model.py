"""A model folder with the public network: everything else stays as it is."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from published_inpainting import random_tensors

from diff4splat.errors import ConfigError
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.checksums import require_complete
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.models.hub.provenance import read_provenance
from diff4splat.models.image_inpainting.add_to_model import add_public_inpainting
from diff4splat.models.image_inpainting.public_weights import WIDTHS, renamed


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A model, and the same with the network."""
    root = tmp_path_factory.mktemp("models")
    config = tiny_size()
    trained = frozenset({"vae", "ldrm"})
    model = Model(config=config, networks=create_networks(config), trained=trained)
    save_model(model, root / "model")
    add_public_inpainting(root / "model", renamed(random_tensors()), root / "with")
    return root / "model", root / "with"


def test_other_parts_are_copied(folders: tuple[Path, Path]) -> None:
    before, after = folders
    for file in before.glob("*.safetensors"):
        assert (after / file.name).read_bytes() == file.read_bytes()
    require_complete(after, "test")


def test_the_network_is_there_and_trained(folders: tuple[Path, Path]) -> None:
    model = load_model(folders[1], parts=("image_inpainting",))
    assert model.config == replace(tiny_size(), image_inpainting=model.config.image_inpainting)
    assert model.config.image_inpainting.widths == WIDTHS
    assert read_provenance(folders[1]).trained == {"vae", "ldrm", "image_inpainting"}
    assert read_provenance(folders[1]).license == "not stated AND MIT"
    assert "MI-GAN (MIT, Places2)" in read_provenance(folders[1]).origin
    found = model.networks.image_inpainting.state_dict()["input.weight"]
    wanted = 2**0.5 * random_tensors()["encoder.b512.fromrgb.weight"]
    torch.testing.assert_close(found, wanted, atol=1e-3, rtol=1e-3)


def test_a_second_one_is_refused(folders: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="got one with it"):
        add_public_inpainting(folders[1], {}, tmp_path / "twice")
    assert not (tmp_path / "twice").exists()
