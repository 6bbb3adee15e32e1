"""The optimisation loop of one stage: steps, density control, evaluation and checkpoints."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import torch
from torch import Tensor

from diff4splat.fitting.divergence_guard import DivergenceGuard, restore_snapshot
from diff4splat.fitting.evaluator import Evaluator, mean_psnr_db
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.log import FitLogger, LogEntry
from diff4splat.fitting.model.density import densify_and_prune
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.objective.gradient_statistics import GradientStatistics
from diff4splat.fitting.objective.step_objective import Objective
from diff4splat.scene.scene import Scene

EVALUATION_FRAMES = 12
"""Held-out frames evaluated during a fit."""
FIRST_SPLIT_STEP = 300
"""First step of a stage that may split Gaussians."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StageSchedule:
    """Length of a stage, its frames and what it reports to."""

    name: str
    objective: Objective
    frames: FrameSchedule
    evaluator: Evaluator
    logger: FitLogger
    extent: float
    """Of the scene, in scene units; scales the learning rates of lengths."""
    steps: int
    first_step: int
    """Steps of earlier stages; frames and harmonics count from the start of the fit."""
    save: Callable[["StageLoop"], None]
    show: Callable[[Callable[[], Scene]], None] | None = None
    """Called after every step with what makes the scene as it is now."""
    fixed: Mapping[str, Tensor] = field(default_factory=dict)
    """Tensors that a checkpoint needs to rebuild the stage."""
    deadline_s: float | None = None
    """Of ``time.perf_counter``."""
    seconds_before: float = 0.0


class StageLoop:
    """Runs the steps of a stage, from ``step`` on."""

    def __init__(self, stage: StageSchedule, model: SceneModel, step: int = 0) -> None:
        self.stage, self.model, self.step = stage, model, step
        self.gradients = GradientStatistics(len(model), model.table.dtype)
        self.guard = DivergenceGuard(model)
        self._start_s = time.perf_counter()
        self._loss = 0.0

    @property
    def degree(self) -> int:
        """Current degree of the spherical harmonics."""
        settings = self.stage.objective.settings
        return min(
            settings.harmonics, (self.stage.first_step + self.step) // settings.harmonics_every
        )

    @property
    def seconds(self) -> float:
        """Time since the start of the fit, including earlier calls."""
        return self.stage.seconds_before + time.perf_counter() - self._start_s

    @property
    def progress(self) -> float:
        """Completed share of the stage."""
        return self.step / max(self.stage.steps, 1)

    def run(self, until: int, advance: Callable[[], None]) -> bool:
        """Run steps up to ``until``; False if the deadline passed before.

        Raises:
            DivergenceError: the loss is not finite or has diverged.
        """
        settings = self.stage.objective.settings
        while self.step < until:
            if self.stage.deadline_s is not None and time.perf_counter() > self.stage.deadline_s:
                return False
            self._take_step()
            self.step += 1
            self._change_density()
            if self.step % settings.judge_every == 0:
                self.evaluate()
            if self.step % settings.checkpoint_every == 0:
                self.stage.save(self)
            advance()
            if self.stage.show is not None:
                self.stage.show(self.scene)
        return True

    def scene(self) -> Scene:
        """The scene as it is now; differentiable."""
        return self.model.scene(self.degree, self.stage.objective.renderer.path)

    def evaluate(self) -> None:
        """Measure quality on a few held-out frames and log it."""
        held_out = self.stage.objective.capture.held_out.nonzero().flatten()
        at = torch.linspace(0, len(held_out) - 1, min(EVALUATION_FRAMES, len(held_out)))
        with torch.no_grad():
            scene = self.scene()
            cameras = self.model.cameras(learning=False)
            indices = held_out[at.round().long()].tolist()
            qualities = self.stage.evaluator.frames(scene, cameras, indices)
        self.stage.logger.record(
            LogEntry(
                stage=self.stage.name,
                step=self.step,
                loss=self._loss,
                gaussians=len(self.model),
                moving=int(self.model.moving_mask.sum()),
                seconds=round(self.seconds, 1),
                held_out_psnr_db=mean_psnr_db(qualities),
            )
        )

    def rewind(self) -> None:
        """Go back to the last good state."""
        restore_snapshot(self.model, self.guard.last_good)
        self.step = self.guard.last_good.step
        self.gradients.reset(len(self.model))

    def tensors(self) -> dict[str, Tensor]:
        """State of the loop outside the parameter table, for a checkpoint."""
        gradients = {
            "pull_total": self.gradients.total,
            "pull_seen": self.gradients.visible_steps,
        }
        return gradients | dict(self.stage.fixed)

    def load(self, tensors: Mapping[str, Tensor]) -> None:
        """Restore the output of ``tensors``."""
        self.gradients.total = tensors["pull_total"]
        self.gradients.visible_steps = tensors["pull_seen"]

    def _take_step(self) -> None:
        stage, number = self.stage, self.stage.first_step + self.step
        time_s, frames = stage.frames.frames(number)
        step = stage.objective.loss(self.model, time_s, frames, self.degree, number)
        self._loss = float(step.loss.detach())
        finite = math.isfinite(self._loss)
        if finite:
            step.loss.backward()
            finite = self._gradients_finite()
        if not self.guard.accepts(self._loss if finite else math.nan):
            self.model.table.optimizer.zero_grad(set_to_none=True)
            return
        self.gradients.add(step.means, step.ndc_scale)
        rates = self.model.rates(stage.objective.settings.rates, stage.extent, self.progress)
        self.model.table.step(rates)
        self.model.clamp_params()
        self.guard.after_step(self.model, self.step)

    def _gradients_finite(self) -> bool:
        gradients = [self.model.table[name].grad for name in self.model.table.names]
        total = sum(float(gradient.sum()) for gradient in gradients if gradient is not None)
        return total - total == 0

    def _change_density(self) -> None:
        density = self.stage.objective.settings.density
        late = self.progress > density.until
        if self.step % density.every or self.step < FIRST_SPLIT_STEP or late:
            return
        generator = torch.Generator().manual_seed(self.stage.first_step + self.step)
        densify_and_prune(self.model, self.gradients.mean(), density, generator)
        self.gradients.reset(len(self.model))
