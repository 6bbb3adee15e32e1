"""A whole recipe: everything that decides a training run, as frozen values with their sources.

"paper" is Diff4Splat (arXiv 2511.00503) §3 and appendix; "MoVieS" is its sibling's public code;
"ours" is a choice made here. Functions in ``configs`` return recipes; ``recipe_json`` stores them.
"""

from dataclasses import dataclass, field

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import ModelConfig
from diff4splat.training.recipe.checks import require
from diff4splat.training.recipe.kinds import StageKind
from diff4splat.training.recipe.requirements import require_fit
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.recipe.trainer import TrainerSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A whole training."""

    name: str
    seed: int
    model: ModelConfig
    stages: tuple[StageRecipe, ...]
    trainer: TrainerSettings = field(default_factory=TrainerSettings)
    removed_stages: tuple[str, ...] = ()
    """Stages of an older recipe file whose kinds no longer exist."""

    def __post_init__(self) -> None:
        names = [stage.name for stage in self.stages]
        require(len(set(names)) == len(names) > 0, "stages", "different names", ", ".join(names))
        for stage in self.stages:
            require_fit(stage, self.model)

    def stage(self, name: str) -> StageRecipe:
        """The stage of that name.

        Raises:
            ConfigError: there is none, or its kind no longer exists.
        """
        for stage in self.stages:
            if stage.name == name:
                return stage
        known = ", ".join(stage.name for stage in self.stages)
        if name in self.removed_stages:
            raise ConfigError(
                f"--stage: expected one of {known}, got {name!r}, whose kind was removed because "
                "it taught the networks nothing; train the stages after it without it"
            )
        raise ConfigError(f"--stage: expected one of {known}, got {name!r}")

    def stage_of_kind(self, kind: StageKind) -> StageRecipe:
        """The first stage of that kind, whatever its name.

        Raises:
            ConfigError: there is none.
        """
        for stage in self.stages:
            if stage.kind == kind:
                return stage
        raise ConfigError(f"recipe {self.name}: expected a {kind} stage, got none; add one")
