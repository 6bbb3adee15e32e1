"""The recipe of the ``small`` size, for two CPU cores or one GPU; its weights ship.

Clips have 17 frames; the input video takes every second one, so targets at the others are times
that the model has not seen. Steps are what two cores do in about two hours altogether; the sizes
follow from that (docs/adr/0015).
"""

from dataclasses import replace

from diff4splat.configs.stages import (
    dynamic_data,
    dynamic_stage,
    generator_stage,
    motion_stage,
    reconstruction_gates,
    static_stage,
)
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.config.sizes import small_size
from diff4splat.training.recipe import (
    DataSettings,
    Gate,
    LossWeights,
    OptimizerSettings,
    Recipe,
    StageRecipe,
    TrainerSettings,
)

RECONSTRUCTION = LossWeights(
    photometric=4.0, perceptual=0.0, depth_log=0.5, motion_size=0.0, motion_width=0.2
)
"""Without the paper's pull to standstill, which costs more than half of what motion gains."""
TRACKS = 512
"""Points from which it is read where things go, also where none of them is judged."""
TRACK_GATE = Gate(measure="track_share", bound=0.8, direction="at_most")


def small_recipe() -> Recipe:
    """Nine of seventeen frames; learning rates of MoVieS and above, steps of a small run.

    The paper's 1e-5 is for a pretrained backbone and 32 GPUs; from nothing MoVieS's 4e-4 is usual.
    """
    model = small_size()
    data = DataSettings(
        size_px=model.size_px,
        frames=model.frames,
        input_stride=2,
        track_stride=TIME_STRIDE,
        augment=True,
        views=2,
        target_frames=4,
    )
    vae = _autoencoder(data)
    sight = _sight(vae, data)
    static = replace(sight, name="static-low", kind="static", steps=400)
    motion = _motion(static, data.tracks)
    dynamic = _dynamic(static, data.tracks)
    return Recipe(
        name="small",
        seed=0,
        model=model,
        stages=(vae, sight, static, motion, dynamic, *_generating(dynamic)),
        trainer=TrainerSettings(ema_decay=0.999, checkpoint_every=200, evaluate_every=400),
    )


def _generating(dynamic: StageRecipe) -> tuple[StageRecipe, ...]:
    """What comes after the reconstruction of true videos."""
    generator = _generator(dynamic)
    return _depth(dynamic), generator, _branch(generator)


def _autoencoder(data: DataSettings) -> StageRecipe:
    return StageRecipe(
        name="vae",
        kind="vae",
        steps=150,
        global_batch=4,
        micro_batch=4,
        trained=("vae",),
        losses=LossWeights(perceptual=0.0),
        optimizer=OptimizerSettings(learning_rate=2e-4, warmup_steps=20),
        data=dynamic_data(replace(data, target_frames=1, tracks=0)),
        gates=(Gate(measure="psnr", bound=28.0),),
    )


def _sight(vae: StageRecipe, data: DataSettings) -> StageRecipe:
    """LDRM from pictures and cameras alone; may run beside the autoencoder."""
    return replace(
        static_stage(vae, data),
        name="sight",
        kind="sight",
        steps=2_000,
        micro_batch=2,
        losses=RECONSTRUCTION,
        optimizer=OptimizerSettings(learning_rate=8e-4, warmup_steps=200),
        true_pictures=True,
        gates=reconstruction_gates(psnr=16.0, depth_correlation=0.5),
    )


def _motion(static: StageRecipe, tracks: int) -> StageRecipe:
    """Many times per clip: without rendering another one costs little."""
    stage = motion_stage(static, tracks)
    return replace(
        stage,
        steps=800,
        global_batch=8,
        micro_batch=8,
        data=replace(stage.data, target_frames=8),
        optimizer=OptimizerSettings(learning_rate=1e-3, warmup_steps=100),
        gates=(TRACK_GATE,),
    )


def _dynamic(static: StageRecipe, tracks: int) -> StageRecipe:
    """Who moves is known by now, so that who does not is held to it."""
    return replace(
        dynamic_stage(static, tracks),
        steps=400,
        losses=replace(static.losses, motion_width=0.05),
        optimizer=replace(static.optimizer, learning_rate=4e-4, warmup_steps=20),
        true_pictures=False,
        gates=(*static.gates, TRACK_GATE),
    )


def _depth(dynamic: StageRecipe) -> StageRecipe:
    """Depth of pictures without a video: seven of each clip, none of them rendered."""
    return replace(
        dynamic,
        name="depth",
        kind="depth",
        steps=6_000,
        global_batch=8,
        micro_batch=8,
        trained=("ldrm",),
        optimizer=OptimizerSettings(learning_rate=2e-3, warmup_steps=200),
        losses=LossWeights(depth_log=1.0, depth_edges=0.5, depth_shift=1.0, sky=0.2),
        data=replace(dynamic.data, target_frames=4, tracks=0),
        gates=(),
    )


def _generator(dynamic: StageRecipe) -> StageRecipe:
    """Captions speak of left and right, so clips are not mirrored here, but where they are encoded.

    Most of what text decides is decided where there is much noise.
    """
    stage = generator_stage(dynamic)
    return replace(
        stage,
        steps=6_000,
        global_batch=16,
        micro_batch=16,
        optimizer=OptimizerSettings(learning_rate=1e-3, warmup_steps=100),
        losses=replace(stage.losses, flow_level=0.4, flow_energy=0.5, flow_motion=200.0),
        data=replace(stage.data, augment=False, tracks=TRACKS),
        level_shift=3.0,
        vary_captions=True,
    )


def _branch(generator: StageRecipe) -> StageRecipe:
    """The motion branch; small beside the video model, so that it sees far more clips.

    Where things are has to be learnt from the picture; at low levels the motion itself shows it.
    """
    return replace(
        generator,
        name="branch",
        kind="branch",
        steps=4_000,
        trained=("dit",),
        losses=replace(generator.losses, flow_motion=1.0, moves=10.0),
        data=replace(generator.data, moments=True),
        level_shift=16.0,
    )
