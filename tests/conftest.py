"""Seeding, dtypes and switches shared by all tests."""

import gc
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# As the command line does, and before torch is loaded: waiting threads sleep.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import jaxtyping
import pytest
import torch
import type_checks
from hypothesis import HealthCheck, settings

type_checks.install()

# Benchmarks are run from the root and belong to no package.
sys.path.append(str(Path(__file__).parents[1]))

# A busy machine is slow, which is no failure.
settings.register_profile("any_load", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any_load")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # Shells start background jobs deaf to interrupts; tests of interrupts would wait for ever.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart() -> None:
    """On a machine without compiled kernels, each process compiles some of them first."""
    # The kernels' compiler takes a second to load, which a single process may not need.
    from kernel_shares import compile_share

    compile_share()


def pytest_collection_finish() -> None:
    """Garbage collection passes over what lives until the end.

    It took a sixth of the time of the tests of generation and captions.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _seeded() -> None:
    # Without a GPU ``torch.manual_seed`` notes the stack for one to come: 1.7 % of all tests' time.
    seed = torch.manual_seed if torch.cuda.is_available() else torch.default_generator.manual_seed
    seed(0)


@contextmanager
def unchecked() -> Iterator[None]:
    """Annotations off, as users run it: what remains is the validation we wrote ourselves."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture
def as_shipped() -> Iterator[None]:
    """Annotations off for one test."""
    with unchecked():
        yield


@pytest.fixture(scope="module")
def module_as_shipped() -> Iterator[None]:
    """Annotations off for all tests of a file and what they share: for hundreds of steps."""
    with unchecked():
        yield
