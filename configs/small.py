"""The recipe of the ``small`` size, for two CPU cores or one GPU; its weights ship.

Clips have 17 frames; the input video takes every second one, so targets at the others are times
that the model has not seen. Steps are what two cores do in about two hours altogether; the sizes
follow from that (docs/adr/0015).
"""

from dataclasses import replace

from diff4splat.configs.stages import (
    dynamic_data,
    dynamic_stage,
    motion_stage,
    reconstruction_gates,
    static_stage,
    video_diffusion_stage,
)
from diff4splat.models.config.networks import TIME_STRIDE
from diff4splat.models.config.sizes import small_size
from diff4splat.training.recipe.data import DataSettings, SourceSettings
from diff4splat.training.recipe.losses import (
    AutoencoderLosses,
    DepthLosses,
    DynamicLosses,
    FlowLosses,
    ImageClassifierLosses,
    MotionDiffusionLosses,
    MotionLosses,
    ObjectMaskLosses,
    ObjectShadowLosses,
    ReconstructionLosses,
)
from diff4splat.training.recipe.optimizer import OptimizerSettings
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import Gate, StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings

RECONSTRUCTION = ReconstructionLosses(photometric=4.0, perceptual=0.0, depth_log=0.5)
MOTION = MotionLosses(displacement_l1=0.0, huber_delta=0.2)
"""Without the paper's L1 norm of displacements, which costs more than half of what motion gains."""
TRACKS = 512
"""Points that give the true motion, also where no stage evaluates them."""
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
        keyframe_stride=TIME_STRIDE,
        augment=True,
        views=2,
        target_frames=4,
    )
    vae = _autoencoder(data)
    pretrain = _posed_video_pretrain(vae, data)
    static = replace(pretrain, name="static-low", kind="static", steps=400)
    dynamic = _dynamic(static, data.tracks)
    video = _video_diffusion(dynamic)
    object_mask = _object_mask(video)
    return Recipe(
        name="small",
        seed=0,
        model=model,
        stages=(
            vae,
            _monocular_depth(vae, data),
            pretrain,
            static,
            _motion(static, data.tracks),
            dynamic,
            video,
            _motion_diffusion(video),
            object_mask,
            _image_classifier(object_mask),
            _object_shadow(object_mask),
        ),
        trainer=TrainerSettings(ema_decay=0.999, checkpoint_every=200, evaluate_every=400),
    )


def _autoencoder(data: DataSettings) -> StageRecipe:
    return StageRecipe(
        name="vae",
        kind="vae",
        steps=150,
        global_batch=4,
        micro_batch=4,
        trained=("vae",),
        losses=AutoencoderLosses(perceptual=0.0),
        optimizer=OptimizerSettings(learning_rate=2e-4, warmup_steps=20),
        data=dynamic_data(replace(data, target_frames=1, tracks=0)),
        gates=(Gate(measure="psnr", bound=28.0),),
    )


def _posed_video_pretrain(vae: StageRecipe, data: DataSettings) -> StageRecipe:
    """LDRM from images and cameras alone; may run beside the autoencoder."""
    return replace(
        static_stage(vae, data),
        name="posed_video_pretrain",
        kind="posed_video_pretrain",
        steps=2_000,
        micro_batch=2,
        losses=RECONSTRUCTION,
        optimizer=OptimizerSettings(learning_rate=8e-4, warmup_steps=200),
        use_ground_truth_frames=True,
        gates=reconstruction_gates(psnr=16.0, depth_correlation=0.5),
    )


def _motion(static: StageRecipe, tracks: int) -> StageRecipe:
    """Many times per clip: without rendering another time costs little."""
    stage = motion_stage(static, tracks)
    return replace(
        stage,
        steps=800,
        global_batch=8,
        micro_batch=8,
        losses=MOTION,
        data=replace(stage.data, target_frames=8),
        optimizer=OptimizerSettings(learning_rate=1e-3, warmup_steps=100),
        gates=(TRACK_GATE,),
    )


def _dynamic(static: StageRecipe, tracks: int) -> StageRecipe:
    """The moving objects are known by now, so a smaller delta holds the others still."""
    return replace(
        dynamic_stage(static, tracks),
        steps=400,
        losses=DynamicLosses(
            reconstruction=RECONSTRUCTION, motion=replace(MOTION, huber_delta=0.05)
        ),
        optimizer=replace(static.optimizer, learning_rate=4e-4, warmup_steps=20),
        use_ground_truth_frames=False,
        gates=(*static.gates, TRACK_GATE),
    )


def _monocular_depth(vae: StageRecipe, data: DataSettings) -> StageRecipe:
    """Depth of single images: seven of each clip, without rendering; LDRM starts from it.

    The image backbone has seen photographs, and learns slowly.
    """
    return replace(
        vae,
        name="monocular_depth",
        kind="monocular_depth",
        steps=6_000,
        global_batch=8,
        micro_batch=8,
        trained=("monocular_depth",),
        losses=DepthLosses(uncertainty=1.0),
        optimizer=OptimizerSettings(
            learning_rate=1e-3, warmup_steps=100, part_rates=(("monocular_depth.backbone", 0.1),)
        ),
        data=dynamic_data(replace(data, target_frames=4, tracks=0)),
        public_backbone=True,
        gates=(),
    )


def _video_diffusion(dynamic: StageRecipe) -> StageRecipe:
    """Captions name left and right, so clips are mirrored with their captions when encoded.

    Text decides most at high noise levels.
    """
    stage = video_diffusion_stage(dynamic)
    return replace(
        stage,
        steps=6_000,
        global_batch=16,
        micro_batch=16,
        optimizer=OptimizerSettings(learning_rate=1e-3, warmup_steps=100),
        losses=FlowLosses(min_level_weighting=0.4, channel_power_exponent=0.5, hidden_weight=8.0),
        data=replace(stage.data, augment=False, tracks=TRACKS),
        timestep_shift=3.0,
        augment_captions=True,
    )


def _motion_diffusion(video: StageRecipe) -> StageRecipe:
    """The motion network: small beside the video model, so it trains on far more clips.

    It has to learn object positions from the image; at low levels the noisy motion shows them.
    """
    return replace(
        video,
        name="motion_diffusion",
        kind="motion_diffusion",
        steps=4_000,
        trained=("motion_unet",),
        losses=MotionDiffusionLosses(min_level_weighting=0.4, motion_mask=10.0, paraphrase=1.0),
        data=replace(video.data, keyframes_only=True),
        timestep_shift=16.0,
    )


def _object_mask(video: StageRecipe) -> StageRecipe:
    """Five prompts for every image: all that a clip shows can be asked for.

    The image backbone has seen photographs, and learns slowly.
    """
    return replace(
        video,
        name="object_mask",
        kind="object_mask",
        steps=6_000,
        trained=("object_mask",),
        losses=ObjectMaskLosses(instances=0.7),
        optimizer=OptimizerSettings(
            learning_rate=1e-3, warmup_steps=200, part_rates=(("object_mask.backbone", 0.1),)
        ),
        data=replace(video.data, keyframes_only=True),
        text_dropout=0.0,
        public_backbone=True,
    )


def _image_classifier(object_mask: StageRecipe) -> StageRecipe:
    """After the object mask, which it corrects: few weights, of which none sees its neighbours."""
    return replace(
        object_mask,
        name="image_classifier",
        kind="image_classifier",
        steps=400,
        trained=("image_classifier",),
        losses=ImageClassifierLosses(),
        optimizer=OptimizerSettings(learning_rate=5e-3, warmup_steps=50),
    )


def _object_shadow(object_mask: StageRecipe) -> StageRecipe:
    """Reads clips of ``prepare synth --without-objects``."""
    return replace(
        object_mask,
        name="object_shadow",
        kind="object_shadow",
        steps=6_000,
        global_batch=8,
        micro_batch=8,
        trained=("object_shadow",),
        losses=ObjectShadowLosses(),
        optimizer=OptimizerSettings(learning_rate=3e-4, warmup_steps=100),
        data=replace(
            object_mask.data,
            sources=(SourceSettings(still_share=0.0),),
            views=4,
            frames=1,
            size_px=(128, 128),
        ),
        public_backbone=False,
    )
