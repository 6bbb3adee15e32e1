"""Seeding, dtypes and switches shared by all tests."""

import os
from collections.abc import Iterator

# As the command line does, and before torch is loaded: waiting threads sleep.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import jaxtyping
import pytest
import torch


@pytest.fixture(autouse=True)
def _seeded() -> None:
    torch.manual_seed(0)


@pytest.fixture
def as_shipped() -> Iterator[None]:
    """Annotations off, as users run it: what remains is the validation we wrote ourselves."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
