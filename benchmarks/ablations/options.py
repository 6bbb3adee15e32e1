"""What the command takes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from ablations.variants import DYNAMIC, MOTION, STATIC
from diff4splat.configs.recipes import find_recipe, with_clips
from diff4splat.training.recipe.overrides import override
from diff4splat.training.recipe.recipe import Recipe


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Train variants of the reconstruction at equal compute and evaluate them on the same clips.

    The same command goes on after any stop; what is trained or evaluated is not done again.
    """

    run: Path
    """Folder of a training run whose autoencoder (stage vae) is over; all start from it."""
    out: Path
    """Folder for all variants, ablations.md, ablations.json and ablations.png."""
    clips: Path | None = None
    """Folder of shards to learn from; if left out, worlds are drawn meanwhile."""
    config: str = "small"
    """Recipe: a name or a JSON file; stages static-low, motion and dynamic are taken from it."""
    set: Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction] = ()
    """Changes of the recipe for all variants, such as trainer.precision=bfloat16."""
    static_steps: int = 300
    """Of static-low in the full variant."""
    motion_steps: int = 300
    """Of motion in the full variant, at the size of static-low."""
    dynamic_steps: int = 300
    """Of dynamic in the full variant, at the size of static-low."""
    items: int = 24
    """Held-out clips to evaluate on: the first so many of the protocol."""
    only: tuple[str, ...] = ()
    """Names of variants to train and evaluate now; the full one always is."""

    def recipe(self) -> Recipe:
        """The recipe that variants change.

        Raises:
            ConfigError: no such recipe or key.
        """
        recipe = override(find_recipe(self.config), [one for given in self.set for one in given])
        return recipe if self.clips is None else with_clips(recipe, self.clips)

    @property
    def steps(self) -> Mapping[str, int]:
        """Of every stage in the full variant."""
        return {STATIC: self.static_steps, MOTION: self.motion_steps, DYNAMIC: self.dynamic_steps}
