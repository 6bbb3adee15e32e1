"""Fits a scene to a capture.

capture ─ points ─ coarse stage: static Gaussians ─ error variation over time ─ fine stage:
Gaussians and motion ─ static ones leave the motion ─ evaluation on held-out frames. A second call
with the same folder resumes the fit.
"""

import torch

from diff4splat.errors import DivergenceError
from diff4splat.fitting.checkpoints.checkpoint import load_checkpoint
from diff4splat.fitting.evaluator import FrameQuality
from diff4splat.fitting.fit_types import FitRequest, FitResult
from diff4splat.fitting.model.prune_static import prune_static, skipped_static_motion
from diff4splat.fitting.optics.camera_model import CameraModel
from diff4splat.fitting.session import FitSession
from diff4splat.fitting.stage_loop import StageLoop
from diff4splat.fitting.stages import COARSE, coarse_stage, fine_stage
from diff4splat.progress.interrupts import uninterrupted
from diff4splat.scene.scene import Scene

TRAINING_FRAMES = 24
"""Training frames evaluated at the end."""


def fit_scene(request: FitRequest) -> FitResult:
    """Fit until both stages or the time limit end; an interrupted fit resumes from its folder.

    Raises:
        InputError, ShapeError: the capture is unusable.
        CheckpointError: the folder belongs to another fit.
        DivergenceError: the loss diverged; the last good state is saved first.
    """
    session = FitSession(request)
    state = load_checkpoint(request.folder, session.fingerprint)
    if state is None:
        session.logger.clear()
    else:
        request.note(f"going on from {state.stage} step {state.step:,}")
    loop = None
    if state is None or state.stage == COARSE:
        loop = coarse_stage(session, state)
        if not _run(session, loop, loop.stage.steps):
            return _result(session, loop, finished=False)
        state = None
    if session.settings.motion != "static":
        loop = fine_stage(session, state, loop.model if loop else None)
        if not _run_fine_stage(session, loop):
            return _result(session, loop, finished=False)
    return _result(session, loop, finished=True)


def _run_fine_stage(session: FitSession, loop: StageLoop) -> bool:
    """Run the fine stage and prune static Gaussians at each check; False at the time limit."""
    checks = session.settings.stillness.checks
    for share in sorted({*checks, 1.0}):
        if loop.progress > share:
            continue
        if not _run(session, loop, round(share * loop.stage.steps)):
            return False
        if share not in checks:
            continue
        skipped = prune_static(loop.model, session.capture, session.settings, loop.degree)
        if skipped is not None:
            session.skipped_work.add(skipped)
        loop.gradients.reset(len(loop.model))
        session.save(loop)
    return True


def _run(session: FitSession, loop: StageLoop, until: int) -> bool:
    """Run steps up to ``until`` and save if stopped; on divergence save the last good state."""
    phases = session.request.phases
    try:
        with phases.phase(loop.stage.name, max(until - loop.step, 0)) as advance:
            finished = loop.run(until, advance)
    except DivergenceError:
        loop.rewind()
        session.save(loop)
        raise
    except KeyboardInterrupt:
        with uninterrupted():
            session.save(loop)
        raise
    if not finished:
        session.save(loop)
    return finished


def _result(session: FitSession, loop: StageLoop, finished: bool) -> FitResult:
    model, degree = loop.model, session.settings.harmonics if finished else loop.degree
    with torch.no_grad():
        scene = model.scene(degree, session.renderer.path)
        cameras = model.cameras(learning=False)
        held_out, training = _evaluate(session, scene, cameras)
    if (skipped := skipped_static_motion(model)) is not None:
        session.skipped_work.add(skipped)
    return FitResult(
        gaussians=scene.gaussians,
        motion=scene.motion,
        split=session.split,
        held_out=held_out,
        training=training,
        skipped_work=session.skipped_work,
        renderer=session.renderer,
        cameras=cameras if session.settings.camera.learn else None,
        learned=session.optics.report(model.table),
        seconds=loop.seconds,
        finished=finished,
    )


def _evaluate(
    session: FitSession, scene: Scene, cameras: CameraModel | None
) -> tuple[list[FrameQuality], list[FrameQuality]]:
    """Quality on all held-out frames and on a few training frames."""
    held_out = session.capture.held_out.nonzero().flatten().tolist()
    training = session.capture.learnt
    at = torch.linspace(0, len(training) - 1, min(TRAINING_FRAMES, len(training))).long()
    frames = training[at].tolist()
    with session.request.phases.phase("evaluate", len(held_out) + len(frames)) as advance:
        return (
            session.evaluator.frames(scene, cameras, held_out, True, advance),
            session.evaluator.frames(scene, cameras, frames, True, advance),
        )
