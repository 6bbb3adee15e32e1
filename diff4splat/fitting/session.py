"""State that all stages of one fit share."""

import time

from torch import Tensor

from diff4splat.data.capture.checks import require_valid_capture
from diff4splat.data.capture.split import report_split
from diff4splat.fitting.checkpoints.checkpoint import FitState, save_checkpoint
from diff4splat.fitting.checkpoints.checkpoint_tensors import require_tensors
from diff4splat.fitting.checkpoints.fingerprint import fingerprint
from diff4splat.fitting.evaluator import Evaluator
from diff4splat.fitting.fit_types import FitRequest
from diff4splat.fitting.frames.frame_renderer import FrameRenderer
from diff4splat.fitting.frames.frame_schedule import FrameSchedule
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.log import FitLogger
from diff4splat.fitting.model.scene_bounds import scene_bounds
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.motions.protocol import LearnedMotion
from diff4splat.fitting.objective.step_objective import Objective
from diff4splat.fitting.optics.learned import LearnedOptics
from diff4splat.fitting.stage_loop import StageLoop, StageSchedule
from diff4splat.progress.skipped import SkippedWorkList


class FitSession:
    """Frames, renderer, optics and checkpoints of one fit."""

    def __init__(self, request: FitRequest) -> None:
        """Check the capture and prepare everything that precedes the first stage.

        Raises:
            InputError, ShapeError: the capture is unusable.
            ConfigError: the renderer or the learned camera parameters do not fit the capture.
        """
        self.request, self.settings = request, request.settings
        self.capture = require_valid_capture(request.capture)
        self.split = report_split(self.capture)
        request.note(f"{self.capture.name} ({self.capture.source}): {self.split}")
        self.renderer = FrameRenderer(
            capture=self.capture,
            backend=request.backend,
            settings=self.settings.camera,
            device=request.device,
        )
        self.optics = LearnedOptics(self.capture, self.settings.camera.learn)
        self.store = FrameStore(
            self.capture, self.settings.picture_memory_mb << 20, self.settings.torch_dtype
        )
        self.bounds = scene_bounds(self.capture)
        self.schedule = FrameSchedule(
            self.capture, self.settings.views_per_step, self.settings.seed
        )
        self.evaluator = Evaluator(renderer=self.renderer, store=self.store)
        self.logger = FitLogger(folder=request.folder, note=request.note)
        self.skipped_work = SkippedWorkList()
        self.fingerprint = fingerprint(self.capture, self.settings, request.init)
        self._start_s = time.perf_counter()

    def loop(
        self,
        name: str,
        model: SceneModel,
        steps: tuple[int, int],
        state: FitState | None,
        fixed: dict[str, Tensor] | None = None,
    ) -> StageLoop:
        """The loop of a stage of ``steps`` = (steps before the stage, steps of the stage)."""
        first_step, count = steps
        limit_s = self.request.stop_after_s
        stage = StageSchedule(
            name=name,
            objective=Objective(renderer=self.renderer, store=self.store, settings=self.settings),
            frames=self.schedule,
            evaluator=self.evaluator,
            logger=self.logger,
            extent=self.bounds.extent,
            steps=count,
            first_step=first_step,
            save=self.save,
            fixed=fixed or {},
            show=self.request.show,
            deadline_s=None if limit_s is None else self._start_s + limit_s,
            seconds_before=state.seconds if state else time.perf_counter() - self._start_s,
        )
        loop = StageLoop(stage, model, state.step if state else 0)
        if state is not None:
            loop.load(state.fixed)
        return loop

    def save(self, loop: StageLoop) -> None:
        """Write a checkpoint.

        Raises:
            OutputError: the folder cannot be created or written.
        """
        state = FitState(
            stage=loop.stage.name,
            step=loop.step,
            fingerprint=self.fingerprint,
            seconds=loop.seconds,
            tensors=loop.model.table.tensors(),
            moving_mask=loop.model.moving_mask,
            fixed=loop.tensors(),
        )
        save_checkpoint(state, self.request.folder)

    def restored_model(self, state: FitState, motion: LearnedMotion) -> SceneModel:
        """The model of a checkpoint.

        Raises:
            CheckpointError: a tensor is missing, or of another shape or dtype.
        """
        require_tensors(state, motion, self.optics, self.settings)
        rows = {name: state.tensors[name] for name in state.tensors if "/" not in name}
        shared = {*motion.shared(), *self.optics.names}
        columns = {name: value for name, value in rows.items() if name not in shared}
        self.optics.resume(rows)
        dtype = self.settings.torch_dtype
        model = SceneModel(columns, motion, state.moving_mask, self.optics, dtype=dtype)
        model.table.load(state.tensors)
        return model
