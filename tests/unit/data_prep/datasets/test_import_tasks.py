"""Tasks of an import on several machines: every sequence once, whatever order a disk has."""

from pathlib import Path

from diff4splat.data_prep.datasets.common.sequence import ListedSequence, Sequence
from diff4splat.data_prep.datasets.importing import ImportJob, of_task


def never() -> Sequence:
    raise AssertionError("dividing the work opens no sequence")


def test_every_sequence_belongs_to_one_task() -> None:
    listed = [ListedSequence(name=f"scene {number}", open=never) for number in range(40)]
    found = []
    for task in range(3):
        job = ImportJob(root=Path(), dataset="spring", folder=Path(), task=task, tasks=3)
        part = [one.name for one in of_task(listed, job)]
        assert part == [one.name for one in of_task(listed[::-1], job)]
        assert part
        found += part
    assert sorted(found) == sorted(one.name for one in listed)
