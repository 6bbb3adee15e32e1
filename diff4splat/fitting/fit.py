"""A capture becomes a scene: coarse stage, who moves, fine stage, who proved still.

capture ─ points ─ coarse: standing Gaussians ─ errors over time ─ fine: Gaussians and motion ─
still ones out ─ judgement on held-out frames. Call again with the same folder to go on.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.data.capture.checks import require_usable_capture
from diff4splat.data.capture.split import SplitReport, report_split
from diff4splat.errors import DivergenceError
from diff4splat.fitting import checkpoint
from diff4splat.fitting.checkpoint import Standing
from diff4splat.fitting.divergence_guard import restore
from diff4splat.fitting.evaluator import FrameQuality, Judge
from diff4splat.fitting.fine_stage_init import Surroundings, depart
from diff4splat.fitting.frame_renderer import Sight
from diff4splat.fitting.identity import fingerprint
from diff4splat.fitting.log import Recorder
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.model_init import (
    create_motion,
    field_bounds,
    initial_model,
    standing_model,
)
from diff4splat.fitting.motions.still import Still
from diff4splat.fitting.objective import Objective
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.pictures import FrameStore, Schedule
from diff4splat.fitting.prune_static import left_standing, take_out_still
from diff4splat.fitting.scene_bounds import Region, find_region
from diff4splat.fitting.settings import FitSettings
from diff4splat.fitting.stage_loop import Course, StageLoop
from diff4splat.fitting.static_detection import error_variation
from diff4splat.progress.phases import Phases
from diff4splat.progress.skipped import SkippedWorkList
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.scene import Scene

COARSE, FINE = "coarse", "fine"


def _quiet(text: str) -> None:
    """Take a note to nobody."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRun:
    """What is asked for."""

    capture: Capture
    settings: FitSettings
    folder: Path
    init: Scene | None = None
    """Start from this scene in place of points; there is no coarse stage then."""
    backend: str = "auto"
    stop_after_s: float | None = None
    phases: Phases = field(default_factory=Phases)
    note: Callable[[str], None] = _quiet


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """What came out."""

    gaussians: Gaussians
    motion: object
    split: SplitReport
    held_out: list[FrameQuality]
    training: list[FrameQuality]
    """A few frames that were learnt from."""
    omissions: SkippedWorkList
    sight: Sight
    """What made the pictures."""
    cameras: CameraModel | None
    """As learned; None where nothing was."""
    learned: dict[str, dict[str, object]]
    """What was learned of the cameras: start and recovered value of each part."""
    seconds: float
    finished: bool
    """False when time ran out: the same call goes on."""


def fit_scene(asked: FitRun) -> FitResult:
    """Fit until the stages are over, or time is; whatever stops it, the folder can go on.

    Raises:
        InputError, ShapeError: the capture cannot be used.
        CheckpointError: the folder belongs to another fit.
        DivergenceError: the loss has left; the last good state is saved in the folder first.
    """
    return _Fit(asked).run()


class _Fit:
    def __init__(self, asked: FitRun) -> None:
        self.asked, self.settings = asked, asked.settings
        self.capture = require_usable_capture(asked.capture)
        self.split = report_split(self.capture)
        asked.note(f"{self.capture.name} ({self.capture.source}): {self.split}")
        self.sight = Sight(
            capture=self.capture, backend=asked.backend, settings=self.settings.camera
        )
        self.optics = LearnedOptics(self.capture, self.settings.camera.learn)
        self.store = FrameStore(self.capture, self.settings.picture_memory_mb << 20)
        self.region: Region = find_region(self.capture)
        self.schedule = Schedule(self.capture, self.settings.views_per_step, self.settings.seed)
        self.judge = Judge(sight=self.sight, store=self.store)
        self.recorder = Recorder(folder=asked.folder, note=asked.note)
        self.omissions = SkippedWorkList()
        self.fingerprint = fingerprint(self.capture, self.settings, asked.init)
        self.began = time.perf_counter()

    def run(self) -> FitResult:
        standing = checkpoint.load(self.asked.folder, self.fingerprint)
        if standing is None:
            self.recorder.start_over()
        else:
            self.asked.note(f"going on from {standing.stage} step {standing.step:,}")
        loop = None
        if standing is None or standing.stage == COARSE:
            loop = self._coarse(standing)
            if not self._run(loop, loop.course.steps):
                return self._result(loop, finished=False)
            standing = None
        if self.settings.motion != "static":
            loop = self._fine(standing, loop.model if loop else None)
            checks = self.settings.stillness.checks
            for share in sorted({*checks, 1.0}):
                if loop.progress > share:
                    continue
                if not self._run(loop, round(share * loop.course.steps)):
                    return self._result(loop, finished=False)
                if share not in checks:
                    continue
                taken = take_out_still(loop.model, self.capture, self.settings, loop.degree)
                if taken is not None:
                    self.omissions.add(taken)
                loop.pull.forget(len(loop.model))
                self._save(loop)
        return self._result(loop, finished=True)

    def _coarse(self, standing: Standing | None) -> StageLoop:
        settings = self.settings
        steps = settings.coarse_steps if self.asked.init is None else 0
        if settings.motion == "static":
            steps += settings.fine_steps
        with self.asked.phases.phase("read capture"):
            if standing is not None:
                model = self._restored(standing, Still(self.capture.time_range_s))
            elif self.asked.init is not None:
                model = initial_model(self.asked.init, self.capture, settings, self.optics)
            else:
                model = standing_model(self.capture, self.region, settings, self.optics)
        return self._loop(COARSE, model, steps, 0, standing)

    def _fine(self, standing: Standing | None, before: SceneModel | None) -> StageLoop:
        settings = self.settings
        if standing is not None:
            self.bounds = standing.fixed["bounds"]
            model = self._restored(standing, create_motion(self.capture, settings, self.bounds))
        else:
            with self.asked.phases.phase("who moves"):
                moves = self._movers(before)
            self.bounds = field_bounds(before.table["means"].detach()[moves])
            motion = create_motion(self.capture, settings, self.bounds)
            around = Surroundings(
                sight=self.sight,
                store=self.store,
                schedule=self.schedule,
                settings=settings,
                known=before.cameras(learning=False),
            )
            leaving = depart(before, moves, motion, around)
            model = SceneModel(leaving.rows, motion, leaving.moves, self.optics, before.table)
            self.asked.note(f"{int(moves.sum()):,} of {len(moves):,} Gaussians may move")
        first = settings.coarse_steps if self.asked.init is None else 0
        return self._loop(FINE, model, settings.fine_steps, first, standing)

    def _movers(self, model: SceneModel) -> Tensor:
        canonical = model.canonical(self.settings.harmonics)
        plain = Gaussians(
            **{name: getattr(canonical, name).detach() for name in canonical.__dataclass_fields__}
        )
        known = model.cameras(learning=False)
        varies = error_variation(plain, self.sight, self.store, self.schedule, known)
        return varies > self.settings.stillness.min_score

    def _loop(
        self, name: str, model: SceneModel, steps: int, first: int, standing: Standing | None
    ) -> StageLoop:
        asked = self.asked
        deadline_s = None if asked.stop_after_s is None else self.began + asked.stop_after_s
        course = Course(
            name=name,
            objective=Objective(sight=self.sight, store=self.store, settings=self.settings),
            schedule=self.schedule,
            judge=self.judge,
            recorder=self.recorder,
            extent=self.region.extent,
            steps=steps,
            first_step=first,
            save=self._save,
            deadline_s=deadline_s,
            seconds_before=standing.seconds if standing else self._seconds_so_far(),
        )
        loop = StageLoop(course, model, standing.step if standing else 0)
        if standing is not None:
            loop.take_over(standing.fixed)
        return loop

    def _seconds_so_far(self) -> float:
        return time.perf_counter() - self.began

    def _run(self, loop: StageLoop, until: int) -> bool:
        """Run a stretch; on divergence the last good state is saved before the error goes on."""
        try:
            with self.asked.phases.phase(loop.course.name, max(until - loop.step, 0)) as advance:
                finished = loop.run(until, advance)
        except DivergenceError:
            restore(loop.model, loop.guard.good)
            loop.step = loop.guard.good.step
            loop.pull.forget(len(loop.model))
            self._save(loop)
            raise
        except KeyboardInterrupt:
            self._save(loop)
            raise
        if not finished:
            self._save(loop)
        return finished

    def _save(self, loop: StageLoop) -> None:
        fixed = loop.tensors()
        if loop.course.name == FINE:
            fixed["bounds"] = self.bounds
        checkpoint.save(
            Standing(
                stage=loop.course.name,
                step=loop.step,
                fingerprint=self.fingerprint,
                seconds=loop.seconds,
                tensors=loop.model.table.tensors(),
                moves=loop.model.moves,
                fixed=fixed,
            ),
            self.asked.folder,
        )

    def _restored(self, standing: Standing, motion) -> SceneModel:
        rows = {name: standing.tensors[name] for name in standing.tensors if "/" not in name}
        shared = {*motion.shared(), *self.optics.names}
        columns = {name: value for name, value in rows.items() if name not in shared}
        self.optics.resumed(rows)
        model = SceneModel(columns, motion, standing.moves, self.optics)
        model.table.load(standing.tensors)
        return model

    def _result(self, loop: StageLoop, finished: bool) -> FitResult:
        model, degree = loop.model, loop.degree if not finished else self.settings.harmonics
        with torch.no_grad():
            scene, known = model.scene(degree, self.sight.path), model.cameras(learning=False)
            held = self.capture.held_out.nonzero().flatten().tolist()
            learnt = self.capture.learnt
            some = learnt[torch.linspace(0, len(learnt) - 1, min(24, len(learnt))).long()].tolist()
            with self.asked.phases.phase("judge", len(held) + len(some)) as advance:
                judged = self.judge.frames(scene, known, held, True, advance)
                trained = self.judge.frames(scene, known, some, True, advance)
        if (standing := left_standing(model)) is not None:
            self.omissions.add(standing)
        return FitResult(
            gaussians=scene.gaussians,
            motion=scene.motion,
            split=self.split,
            held_out=judged,
            training=trained,
            omissions=self.omissions,
            sight=self.sight,
            cameras=known if self.settings.camera.learn else None,
            learned=self.optics.facts(model.table),
            seconds=loop.seconds,
            finished=finished,
        )
