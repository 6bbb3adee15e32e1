"""Start of the two stages of a fit.

The coarse stage fits static Gaussians to all times. The fine stage adds a motion for the Gaussians
whose error varies over time.
"""

from dataclasses import fields

from jaxtyping import Bool
from torch import Tensor

from diff4splat.fitting.checkpoints.checkpoint import FitState
from diff4splat.fitting.checkpoints.checkpoint_tensors import stored_bounds
from diff4splat.fitting.model.fine_stage_init import InitContext, init_fine_stage
from diff4splat.fitting.model.model_init import (
    create_motion,
    field_bounds,
    model_from_scene,
    static_model,
)
from diff4splat.fitting.model.scene_model import SceneModel
from diff4splat.fitting.model.static_detection import error_variation
from diff4splat.fitting.motions.static import NoMotion
from diff4splat.fitting.session import FitSession
from diff4splat.fitting.stage_loop import StageLoop
from diff4splat.scene.gaussians import Gaussians

COARSE, FINE = "coarse", "fine"


def coarse_stage(session: FitSession, state: FitState | None) -> StageLoop:
    """The coarse stage, at its start or at a checkpoint ``state``."""
    settings, init = session.settings, session.request.init
    steps = settings.coarse_steps if init is None else 0
    if settings.motion == "static":
        steps += settings.fine_steps
    with session.request.phases.phase("read capture"):
        if state is not None:
            model = session.restored_model(state, NoMotion(session.capture.time_range_s))
        elif init is not None:
            model = model_from_scene(init, session.capture, settings, session.optics)
        else:
            model = static_model(session.capture, session.bounds, settings, session.optics)
    return session.loop(COARSE, model, (0, steps), state)


def fine_stage(session: FitSession, state: FitState | None, coarse: SceneModel | None) -> StageLoop:
    """The fine stage, from the ``coarse`` model or from a checkpoint ``state``."""
    settings = session.settings
    if state is not None:
        bounds = stored_bounds(state, settings.torch_dtype)
        motion = create_motion(session.capture, settings, bounds)
        model = session.restored_model(state, motion)
    else:
        with session.request.phases.phase("detect motion"):
            moving_mask = _moving_mask(session, coarse)
        bounds = field_bounds(coarse.table["means"].detach()[moving_mask])
        motion = create_motion(session.capture, settings, bounds)
        context = InitContext(
            renderer=session.renderer,
            store=session.store,
            schedule=session.schedule,
            settings=settings,
            cameras=coarse.cameras(learning=False),
        )
        start = init_fine_stage(coarse, moving_mask, motion, context)
        model = SceneModel(
            *(start.rows, motion, start.moving_mask, session.optics, coarse.table),
            dtype=settings.torch_dtype,
        )
        session.request.note(
            f"{int(moving_mask.sum()):,} of {len(moving_mask):,} Gaussians may move"
        )
    first_step = settings.coarse_steps if session.request.init is None else 0
    return session.loop(FINE, model, (first_step, settings.fine_steps), state, {"bounds": bounds})


def _moving_mask(session: FitSession, model: SceneModel) -> Bool[Tensor, " n"]:
    """Gaussians whose error varies over time by more than ``min_score``."""
    canonical = model.canonical(session.settings.harmonics)
    detached = Gaussians(
        **{entry.name: getattr(canonical, entry.name).detach() for entry in fields(canonical)}
    )
    variation = error_variation(
        detached,
        session.renderer,
        session.store,
        session.schedule,
        model.cameras(learning=False),
    )
    return variation > session.settings.stillness.min_score
