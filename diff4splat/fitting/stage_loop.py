"""One stage of a fit: steps, more and fewer Gaussians, judgements and checkpoints."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from diff4splat.fitting.density import Pull, grow_and_prune
from diff4splat.fitting.divergence_guard import Guard
from diff4splat.fitting.evaluator import Judge, mean_psnr_db
from diff4splat.fitting.log import Reading, Recorder
from diff4splat.fitting.model import SceneModel
from diff4splat.fitting.objective import Objective
from diff4splat.fitting.pictures import Schedule

LIVE_FRAMES = 12
"""Held-out frames that are looked at while a fit runs."""
FIRST_GROWTH = 300
"""Steps before Gaussians are split for the first time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What a stage needs beside its model."""

    name: str
    objective: Objective
    schedule: Schedule
    judge: Judge
    recorder: Recorder
    extent: float
    steps: int
    first_step: int
    """Of the whole fit: schedules and harmonics count from its beginning."""
    save: Callable[["StageLoop"], None]
    deadline_s: float | None = None
    """Of ``time.perf_counter``."""
    seconds_before: float = 0.0


class StageLoop:
    """Runs the steps of a stage from wherever they are."""

    def __init__(self, course: Course, model: SceneModel, step: int = 0) -> None:
        self.course, self.model, self.step = course, model, step
        self.pull = Pull(len(model))
        self.guard = Guard(model)
        self._began = time.perf_counter()
        self._loss = 0.0

    @property
    def degree(self) -> int:
        """Of the harmonics that take part by now."""
        settings = self.course.objective.settings
        return min(
            settings.harmonics, (self.course.first_step + self.step) // settings.harmonics_every
        )

    @property
    def seconds(self) -> float:
        """Since the fit began, those of earlier calls included."""
        return self.course.seconds_before + time.perf_counter() - self._began

    @property
    def progress(self) -> float:
        """Share of the stage that is over."""
        return self.step / max(self.course.steps, 1)

    def run(self, until: int, advance: Callable[[], None]) -> bool:
        """Take steps up to ``until``; False when time ran out before.

        Raises:
            DivergenceError: the loss is not finite or has left for good.
        """
        settings = self.course.objective.settings
        while self.step < until:
            if self.course.deadline_s is not None and time.perf_counter() > self.course.deadline_s:
                return False
            self._take_step()
            self.step += 1
            self._change_density()
            if self.step % settings.judge_every == 0:
                self.judge()
            if self.step % settings.checkpoint_every == 0:
                self.course.save(self)
            advance()
        return True

    def judge(self) -> None:
        """Look at a few held-out frames and say how it goes."""
        held = self.course.objective.capture.held_out.nonzero().flatten()
        some = torch.linspace(0, len(held) - 1, min(LIVE_FRAMES, len(held))).round().long()
        with torch.no_grad():
            scene = self.model.scene(self.degree, self.course.objective.sight.path)
            known = self.model.cameras(learning=False)
            found = self.course.judge.frames(scene, known, held[some].tolist())
        self.course.recorder.record(
            Reading(
                stage=self.course.name,
                step=self.step,
                loss=self._loss,
                gaussians=len(self.model),
                moving=int(self.model.moves.sum()),
                seconds=round(self.seconds, 1),
                held_out_psnr_db=mean_psnr_db(found),
            )
        )

    def _take_step(self) -> None:
        course, number = self.course, self.course.first_step + self.step
        time_s, frames = course.schedule.frames(number)
        step = course.objective.loss(self.model, time_s, frames, self.degree, number)
        self._loss = float(step.loss.detach())
        finite = math.isfinite(self._loss)
        if finite:
            step.loss.backward()
            finite = self._gradients_finite()
        if not self.guard.accepts(self._loss if finite else math.nan):
            self.model.table.optimizer.zero_grad(set_to_none=True)
            return
        self.pull.add(step.means, step.half_pictures)
        rates = self.model.rates(course.objective.settings.rates, course.extent, self.progress)
        self.model.table.step(rates)
        self.model.bound()
        self.guard.passed(self.model, self.step)

    def _gradients_finite(self) -> bool:
        gradients = [self.model.table[name].grad for name in self.model.table.names]
        total = sum(float(gradient.sum()) for gradient in gradients if gradient is not None)
        return total - total == 0

    def _change_density(self) -> None:
        density = self.course.objective.settings.density
        late = self.progress > density.until
        if self.step % density.every or self.step < FIRST_GROWTH or late:
            return
        generator = torch.Generator().manual_seed(self.course.first_step + self.step)
        grow_and_prune(self.model, self.pull.mean(), density, generator)
        self.pull = Pull(len(self.model))

    def tensors(self) -> dict[str, Tensor]:
        """What the next step needs beside the table."""
        return {"pull_total": self.pull.total, "pull_seen": self.pull.seen}

    def take_over(self, tensors: dict[str, Tensor]) -> None:
        """Put back what ``tensors()`` gave."""
        self.pull.total, self.pull.seen = tensors["pull_total"], tensors["pull_seen"]
