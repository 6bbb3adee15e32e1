"""Many cases of many readers: a process at work, restarted when it hangs or dies."""

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from fuzz.cases import Edit
from fuzz.outcome import FAILURES, FOREIGN, HANG, Outcome

START_S = 300
"""For imports and the example; the limit per case counts from the first answer on."""


@dataclass(slots=True)
class Failure:
    """All failures of one cause."""

    index: int
    """The first case."""
    outcome: Outcome
    edits: list[Edit]
    """Those of the first case that are needed."""
    count: int = 1


@dataclass(slots=True)
class Tally:
    """What became of the cases of one reader."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[str, Failure] = field(default_factory=dict)


class Campaign:
    """Cases of one seed; a process without an answer for ``limit_s`` is taken to wait for ever."""

    def __init__(self, seed: int, limit_s: float = 60.0) -> None:
        self.seed, self.limit_s = seed, limit_s
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-")
        self._process: subprocess.Popen | None = None
        self._lines: queue.Queue[str | None] = queue.Queue()

    def __enter__(self) -> "Campaign":
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()
        self._folder.cleanup()

    def run(self, reader: str, indices: Iterable[int]) -> Tally:
        """All cases of one reader; the first failure of each cause is reduced."""
        tally = Tally()
        for index in indices:
            edits, outcome = self._case(reader, index)
            tally.counts[outcome.kind] += 1
            if outcome.kind not in FAILURES:
                continue
            cause = f"{outcome.kind} {outcome.where}"
            if cause in tally.failures:
                tally.failures[cause].count += 1
            else:
                needed = self._reduced(reader, index, edits, outcome)
                tally.failures[cause] = Failure(index, outcome, needed)
        return tally

    def _reduced(self, reader: str, index: int, edits: list[Edit], outcome: Outcome) -> list[Edit]:
        """Without edits that the failure does not need."""
        left_out: list[int] = []
        for place in range(len(edits)):
            without = [*left_out, place]
            _, again = self._case(reader, index, without)
            if (again.kind, again.where) == (outcome.kind, outcome.where):
                left_out = without
        return [edit for place, edit in enumerate(edits) if place not in left_out]

    def _case(
        self, reader: str, index: int, left_out: Sequence[int] = ()
    ) -> tuple[list[Edit], Outcome]:
        if self._process is None:
            self._start()
        self._process.stdin.write(json.dumps([reader, self.seed, index, left_out]) + "\n")
        self._process.stdin.flush()
        drawn = self._answer(START_S)
        if drawn is None:
            raise RuntimeError(f"{reader}: no valid example; try python -m fuzz.worker")
        edits = [Edit(*values) for values in drawn]
        result = self._answer(self.limit_s)
        if result is not None:
            return edits, Outcome(*result)
        died = self._process.poll() is not None
        self._stop()
        return edits, Outcome(FOREIGN, "process died") if died else Outcome(HANG)

    def _answer(self, limit_s: float) -> list | None:
        try:
            line = self._lines.get(timeout=limit_s)
        except queue.Empty:
            return None
        if line is None:
            self._process.wait()
            return None
        return json.loads(line)

    def _start(self) -> None:
        environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "fuzz.worker", self._folder.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        self._lines = queue.Queue()
        arguments = (self._process.stdout, self._lines)
        threading.Thread(target=_read_lines, args=arguments, daemon=True).start()

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process.stdin.close()
            self._process = None


def _read_lines(stream: Iterator[str], lines: "queue.Queue[str | None]") -> None:
    with stream:
        for line in stream:
            lines.put(line)
    lines.put(None)
