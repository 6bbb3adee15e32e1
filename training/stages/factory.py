"""Which stage a recipe means."""

from collections.abc import Mapping
from types import MappingProxyType

from diff4splat.models.factory import Networks
from diff4splat.training.recipe import StageKind
from diff4splat.training.stages.autoencoder import AutoencoderStage
from diff4splat.training.stages.branch import MotionDiffusionStage
from diff4splat.training.stages.depth import DepthStage
from diff4splat.training.stages.generator import VideoDiffusionStage
from diff4splat.training.stages.joint import JointStage
from diff4splat.training.stages.model_stage import ModelStage, StagePlan
from diff4splat.training.stages.reconstruction import (
    DynamicStage,
    MotionStage,
    SightStage,
    StaticStage,
)

STAGES: Mapping[StageKind, type[ModelStage]] = MappingProxyType(
    {
        "vae": AutoencoderStage,
        "sight": SightStage,
        "static": StaticStage,
        "motion": MotionStage,
        "depth": DepthStage,
        "branch": MotionDiffusionStage,
        "dynamic": DynamicStage,
        "generator": VideoDiffusionStage,
        "joint": JointStage,
    }
)


def create_stage(networks: Networks, plan: StagePlan) -> ModelStage:
    """The stage with the parts of ``networks`` that it runs.

    Raises:
        ConfigError: a part is to be trained that the stage does not run.
    """
    return STAGES[plan.recipe.kind](networks, plan)
