"""A few damaged examples of every reader, and what the harness says of readers that break."""

from pathlib import Path
from random import Random

import pytest

from diff4splat.errors import FileFormatError
from fuzz.campaign import Campaign
from fuzz.cases import Example
from fuzz.edits.container_edits import edits_of
from fuzz.outcome import FAILURES, FOREIGN, MEMORY, REFUSED, outcome_of
from fuzz.readers import READERS

SEED, CASES = 0, 6
WAIT_S = 600.0
"""A machine under load may be slow; only a process that waits for ever takes so long."""


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    with Campaign(SEED, WAIT_S) as campaign:
        yield campaign


@pytest.mark.parametrize("reader", READERS)
def test_damage_is_read_or_refused(campaign: Campaign, reader: str) -> None:
    tally = campaign.run(reader, range(CASES))
    assert not tally.failures
    assert sum(tally.counts.values()) == CASES
    assert not set(tally.counts) & set(FAILURES)


def test_the_same_seed_draws_the_same_damage(tmp_path: Path) -> None:
    READERS["protocol"].make(tmp_path)
    example = Example(tmp_path)
    first, again = (example.draw(Random("1/protocol/7")) for _ in range(2))
    assert first == again
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for number in range(40):
        edits = example.draw(Random(number))
        example.damage(edits)
        example.restore(edits)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_edits_know_what_they_edit() -> None:
    assert "change_value" in edits_of(b'{"a": 1}')
    assert "edit_npy" in edits_of(b"\x93NUMPY\x01\x00")
    assert "change_value" not in edits_of(b"\x93NUMPY\x01\x00")


def _raised(*errors: Exception) -> Exception:
    """The last of these, caused by those before."""
    cause = None
    for error in errors:
        try:
            raise error from cause
        except Exception as caught:
            cause = caught
    return cause


def test_only_errors_of_ours_are_refusals() -> None:
    assert outcome_of(_raised(FileFormatError("no"))).kind == REFUSED
    assert outcome_of(_raised(KeyError("a"), FileFormatError("no"))).kind == REFUSED
    assert outcome_of(_raised(KeyError("a"))).kind == FOREIGN
    assert outcome_of(_raised(MemoryError(), FileFormatError("no"))).kind == MEMORY
    full = RuntimeError("DefaultCPUAllocator: can't allocate memory")
    assert outcome_of(_raised(full)).kind == MEMORY
