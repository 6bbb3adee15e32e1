"""Models of the ``test`` size with weights that no factory draws, packed as they would ship."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub import bundled_weights
from diff4splat.models.hub.export import export_model
from diff4splat.models.hub.model import Model, load_model, save_model

TRAINED = ("vae", "ldrm", "deformation")


def trained_folder(folder: Path, trained: tuple[str, ...] = TRAINED) -> Path:
    """A model folder as training writes it: all parts, float32, ``trained`` ones far from fresh."""
    networks = create_networks(tiny_size())
    generator = torch.Generator().manual_seed(11)
    for name in trained:
        for parameter in getattr(networks, name).parameters():
            parameter.data = 0.1 * torch.randn(parameter.shape, generator=generator)
    model = Model(config=tiny_size(), networks=networks, trained=frozenset(trained))
    save_model(model, folder)
    return folder


def packed_folder(tmp_path: Path, trained: tuple[str, ...] = TRAINED) -> Path:
    """The same, packed."""
    model = load_model(trained_folder(tmp_path / "run-model", trained))
    export_model(model, tmp_path / "weights" / "test", license="MIT", origin="made by a test")
    return tmp_path / "weights" / "test"


def ship(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trained: tuple[str, ...] = TRAINED
) -> Path:
    """Make the packed folder what the package finds under the name of its size."""
    folder = packed_folder(tmp_path, trained)
    monkeypatch.setattr(bundled_weights, "WEIGHTS_FOLDER", folder.parent)
    return folder


def random_model() -> Model:
    """What a size without shipped weights gives."""
    config = tiny_size()
    return Model(config=config, networks=create_networks(config))


def as_trained(model: Model, *parts: str) -> Model:
    """The same networks under another claim."""
    return replace(model, trained=frozenset(parts))
