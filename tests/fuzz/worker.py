"""One process that reads damaged examples: jobs come as lines, two lines go back for each.

Run as ``python -m fuzz.worker FOLDER``. A job is ``[reader, seed, index, left_out]``. The first
answer says which edits were drawn, so that a process that never answers again still tells.
"""

import json
import os
import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from random import Random

from fuzz.cases import Edit, Example
from fuzz.outcome import HANG, OK, Outcome, outcome_of
from fuzz.readers import READERS

MEMORY_BYTES = 2 << 30
"""What one read may add to the address space of the process."""
LIMIT_S = 10.0
"""Of processor time, so that a busy machine changes nothing."""


class Reading:
    """Examples on disk, one per reader, made when they are first needed."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._examples = folder, {}

    def edits(self, reader: str, seed: int, index: int, left_out: Sequence[int]) -> list[Edit]:
        """The edits of a case, without some of them."""
        drawn = self._example(reader).draw(Random(f"{seed}/{reader}/{index}"))
        return [edit for place, edit in enumerate(drawn) if place not in left_out]

    def outcome(self, reader: str, edits: Sequence[Edit]) -> Outcome:
        """What the reader makes of it."""
        example = self._example(reader)
        example.damage(edits)
        limit_memory(MEMORY_BYTES)
        start_s = time.process_time()
        try:
            READERS[reader].read(example.folder)
            outcome = Outcome(OK)
        except Exception as error:
            outcome = outcome_of(error)
        finally:
            limit_memory(None)
            example.restore(edits)
        seconds = time.process_time() - start_s
        return outcome if seconds < LIMIT_S else Outcome(HANG, message=f"{seconds:.0f} s")

    def _example(self, reader: str) -> Example:
        if reader not in self._examples:
            folder = self._folder / reader.replace(" ", "-")
            folder.mkdir()
            READERS[reader].make(folder)
            READERS[reader].read(folder)  # compiles, imports and proves that it is valid
            self._examples[reader] = Example(folder)
        return self._examples[reader]


def limit_memory(more: int | None) -> None:
    """Limit the address space to ``more`` bytes above what is in use; None removes the limit."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    used = pages * resource.getpagesize()
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (hard if more is None else used + more, hard))


def main() -> None:
    """Answer jobs until there are no more."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory(dir=sys.argv[1]) as folder:
        reading = Reading(Path(folder))
        for line in sys.stdin:
            reader, *case = json.loads(line)
            edits = reading.edits(reader, *case)
            answers.write(json.dumps([astuple(edit) for edit in edits]) + "\n")
            answers.write(json.dumps(astuple(reading.outcome(reader, edits))) + "\n")


if __name__ == "__main__":
    main()
