"""Runs that several test files look at; each is made once."""

from pathlib import Path

import pytest
from clip_shards import write_shards
from training_commands import SAVING, STAGES, train


@pytest.fixture(scope="session")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), still=4, moving=4)


@pytest.fixture(scope="session")
def course(shards: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run")
    for stage in STAGES:
        assert train(stage, shards, out, "--ignore-gates") == 0
    return out


@pytest.fixture(scope="session")
def six_steps(shards: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An autoencoder that was never stopped."""
    out = tmp_path_factory.mktemp("six")
    assert train("vae", shards, out, *SAVING, steps=6) == 0
    return out
