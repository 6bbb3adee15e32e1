"""All renderers on one scene, their windows interleaved, so that ratios come from one stretch.

Every renderer loads the scene in a worker of its own and makes its first calls; then, round after
round, each in turn has one window forward and one forward + backward, until it has used up its
seconds. What disturbs the machine for a while disturbs all of them.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from loading import Peer
from records import KINDS, Cell, GradientError, ImageError, Kind, Timing, Work, timing
from scenes import Scene
from workers.process import Limits, Worker, WorkerFailure
from workers.render_worker import GroundTruthWorker, RenderWorker

from timing.machine import Disturbance

Say = Callable[[str], None]
_HOPELESS, _TRUTH_S = 4, 1800.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How long and how hard to measure."""

    seconds: float
    """Per renderer and scene."""
    patience_s: float
    """A renderer whose first call takes longer is measured by that call alone."""
    memory_bytes: int
    """What one worker may allocate."""
    window_s: float = 0.02
    """A window is as many calls as fill this."""
    checks: bool = True
    """Compare images and gradients with the truth."""

    def limits(self, threads: int) -> Limits:
        """The same for one worker; the hopeless are stopped after some times the patience."""
        answer_s = _HOPELESS * self.patience_s
        return Limits(threads=threads, memory_bytes=self.memory_bytes, answer_s=answer_s)

    def truth_limits(self) -> Limits:
        """Brute force may take its time."""
        return Limits(threads=1, memory_bytes=self.memory_bytes, answer_s=_TRUTH_S)


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """A scene, the work in it, and where its truth lies."""

    scene: Scene
    work: Work
    truth_file: Path | None
    """None where nothing is compared."""


def find_subject(scene: Scene, folder: Path, effort: Effort) -> Subject:
    """Count the work in a scene and write its truth into ``folder``, in a process of its own."""
    file = folder / f"{scene.name}.pt"
    try:
        with Worker(GroundTruthWorker, effort.truth_limits()) as desk:
            work = desk.ask("find", scene, file, effort.checks)
    except WorkerFailure as failure:
        pixels = scene.size_px[0] * scene.size_px[1]
        reason = f"truth: {failure}"
        work = Work(scene=scene.name, gaussians=scene.count, pixels=pixels, reason=reason)
    known = effort.checks and not work.reason
    return Subject(scene=scene, work=work, truth_file=file if known else None)


def measure(
    subject: Subject, peers: Sequence[Peer], threads: int, effort: Effort, say: Say
) -> list[Cell]:
    """One cell per renderer, in their order; ``say`` hears what is being done."""
    name, disturbance = subject.scene.name, Disturbance()
    turns = [Turn(peer=peer, scene=subject.scene, threads=threads, effort=effort) for peer in peers]
    with ExitStack() as stack:
        for turn in turns:
            stack.callback(turn.close)
            say(f"{name}: {turn.peer.name}")
            turn.begin(subject.truth_file)
        number = 1
        while any(turn.unfinished for turn in turns):
            for turn in (turn for turn in turns if turn.unfinished):
                say(f"{name}: {turn.peer.name}, round {number}")
                turn.round()
            number += 1
    # Only now are the workers' own seconds known.
    others = disturbance.cores()
    return [turn.cell(others) for turn in turns]


@dataclass(slots=True, kw_only=True)
class Turn:
    """One renderer on one scene, as it goes through the rounds."""

    peer: Peer
    scene: Scene
    threads: int
    effort: Effort
    reason: str = ""
    note: str = ""
    judged: bool = True
    image: ImageError | None = None
    gradients: tuple[GradientError, ...] = ()
    unfinished: list[Kind] = field(default_factory=list)
    """Kinds of calls that still have windows to come."""
    _worker: Worker | None = None
    _firsts: dict[Kind, tuple[float, int]] = field(default_factory=dict)
    _windows: dict[Kind, list[float]] = field(default_factory=dict)
    _spent_s: float = 0.0

    def begin(self, truth_file: Path | None) -> None:
        """Load, prepare, call once, and compare with the truth."""
        if self.peer.unavailable is not None:
            self.reason = self.peer.unavailable
            return
        try:
            self._worker = Worker(RenderWorker, self.effort.limits(self.threads))
            self.note, self.judged = self._worker.ask("load", self.peer.file)
            refused = self._worker.ask("prepare", self.scene)
            if refused is not None:
                self.reason = refused
                return
        except WorkerFailure as failure:
            self.reason = str(failure)
            return
        for kind in KINDS:
            self._first(kind, truth_file)

    def _first(self, kind: Kind, truth_file: Path | None) -> None:
        assert self._worker is not None
        try:
            first = self._worker.ask("first", kind)
            if first is None:
                return
            self._firsts[kind] = first
            if first[0] <= self.effort.patience_s:
                self.unfinished.append(kind)
            if truth_file is not None:
                self._check(kind, truth_file)
        except WorkerFailure as failure:
            self._stop(kind, failure)

    def _check(self, kind: Kind, truth_file: Path) -> None:
        assert self._worker is not None
        if kind == "forward":
            self.image = self._worker.ask("check_image", truth_file)
        else:
            self.gradients = self._worker.ask("check_gradients", truth_file)

    def round(self) -> None:
        """One window of each kind that is still to come."""
        assert self._worker is not None
        for kind in tuple(self.unfinished):
            try:
                seconds = self._worker.ask("window", kind, self.effort.window_s)
            except WorkerFailure as failure:
                self._stop(kind, failure)
                continue
            self._windows.setdefault(kind, []).append(seconds)
            self._spent_s += max(seconds, self.effort.window_s)
        if self._spent_s >= self.effort.seconds:
            self.unfinished.clear()

    def _stop(self, kind: Kind, failure: WorkerFailure) -> None:
        self.unfinished = [other for other in self.unfinished if other != kind]
        self.reason = self.reason or f"{_WORDS[kind]}: {failure}"

    def cell(self, others_cores: float) -> Cell:
        """What was measured."""
        return Cell(
            peer=self.peer.name,
            scene=self.scene.name,
            threads=self.threads,
            reason=self.reason,
            note=self.note,
            judged=self.judged,
            others_cores=others_cores,
            forward=self._timing("forward"),
            both=self._timing("both"),
            image=self.image,
            gradients=self.gradients,
        )

    def _timing(self, kind: Kind) -> Timing | None:
        if kind not in self._firsts:
            return None
        return timing(self._windows.get(kind, []), *self._firsts[kind])

    def close(self) -> None:
        """End the worker."""
        if self._worker is not None:
            self._worker.close()


_WORDS: dict[Kind, str] = {"forward": "forward", "both": "backward"}
