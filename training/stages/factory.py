"""The stage of each kind."""

from collections.abc import Mapping
from types import MappingProxyType

from diff4splat.models.networks import Networks
from diff4splat.training.recipe.kinds import StageKind
from diff4splat.training.stages.kinds.dynamic import DynamicStage
from diff4splat.training.stages.kinds.image_classifier import ImageClassifierStage
from diff4splat.training.stages.kinds.joint import JointStage
from diff4splat.training.stages.kinds.monocular_depth import MonocularDepthStage
from diff4splat.training.stages.kinds.motion import MotionStage
from diff4splat.training.stages.kinds.motion_diffusion import MotionDiffusionStage
from diff4splat.training.stages.kinds.object_mask import ObjectMaskStage
from diff4splat.training.stages.kinds.object_shadow import ObjectShadowStage
from diff4splat.training.stages.kinds.posed_video_pretrain import PosedVideoPretrainStage
from diff4splat.training.stages.kinds.static import StaticStage
from diff4splat.training.stages.kinds.vae import AutoencoderStage
from diff4splat.training.stages.kinds.video_diffusion import VideoDiffusionStage
from diff4splat.training.stages.kinds.video_distillation import VideoDistillationStage
from diff4splat.training.stages.model_stage import ModelStage, StagePlan

STAGES: Mapping[StageKind, type[ModelStage]] = MappingProxyType(
    {
        "vae": AutoencoderStage,
        "posed_video_pretrain": PosedVideoPretrainStage,
        "static": StaticStage,
        "motion": MotionStage,
        "dynamic": DynamicStage,
        "monocular_depth": MonocularDepthStage,
        "motion_diffusion": MotionDiffusionStage,
        "object_mask": ObjectMaskStage,
        "image_classifier": ImageClassifierStage,
        "object_shadow": ObjectShadowStage,
        "video_diffusion": VideoDiffusionStage,
        "video_distillation": VideoDistillationStage,
        "joint": JointStage,
    }
)


def create_stage(networks: Networks, plan: StagePlan) -> ModelStage:
    """The stage with the parts of ``networks`` that it runs.

    Raises:
        ConfigError: a part is to be trained that the stage does not run.
    """
    return STAGES[plan.recipe.kind](networks, plan)
