"""What all stages share: parts of a model, trained or frozen."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from diff4splat.errors import ConfigError
from diff4splat.metrics.features.protocol import PerceptualFeatures
from diff4splat.models.adapters.tuning import prepare_tuning
from diff4splat.models.config.model import ModelConfig
from diff4splat.models.networks import Networks
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import Stage
from diff4splat.training.stages.randomness import StageRandom

Terms = Mapping[str, Float[Tensor, " b"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class StagePlan:
    """What a stage is made from."""

    model: ModelConfig
    recipe: StageRecipe
    seed: int
    features: PerceptualFeatures
    """Compares images in the perceptual term; not called when its weight is 0."""
    defer_renders: bool = False
    """Images are rendered again, one by one, in the backward pass."""

    @property
    def random(self) -> StageRandom:
        """The random draws of the stage."""
        recipe = self.recipe
        return StageRandom(seed=self.seed, stage=recipe.name, global_batch=recipe.global_batch)


class ModelStage(Stage):
    """Parts of a model as submodules; frozen parts have no gradient and stay in eval.

    Abstract: every kind is a final class with its losses, metrics and preview.
    """

    parts: tuple[str, ...] = ()
    """Names of the parts that run in this stage; no other part is stored."""

    @classmethod
    def needed(cls, model: ModelConfig) -> tuple[str, ...]:
        """Names of the parts that run with such a model."""
        del model
        return cls.parts

    def __init__(self, networks: Networks, plan: StagePlan) -> None:
        super().__init__()
        self.plan, self.random = plan, plan.random
        self.parts = self.needed(plan.model)
        self.trained = _require_parts(plan.recipe, self.parts)
        for name, part in networks.parts():
            if name in self.parts:
                self.add_module(name, part.requires_grad_(name in self.trained))
        if "dit" in self.trained:
            prepare_tuning(networks.dit, plan.recipe.tuning, plan.recipe.lora_rank, plan.seed)
        self.train()

    def train(self, mode: bool = True) -> "ModelStage":
        """Frozen parts stay in eval."""
        super().train(mode)
        for name in self.parts:
            if name not in self.trained:
                getattr(self, name).eval()
        return self


def _require_parts(recipe: StageRecipe, parts: Collection[str]) -> tuple[str, ...]:
    unknown = [name for name in recipe.trained if name not in parts]
    if unknown or not recipe.trained:
        raise ConfigError(
            f"stage {recipe.name}: expected trained parts among {', '.join(parts)}, got "
            f"{', '.join(unknown) or 'none'}; a {recipe.kind} stage does not run others"
        )
    return recipe.trained
