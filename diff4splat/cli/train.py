"""``diff4splat train``: train one stage of a recipe, or resume it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.models.hub.model import Model


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train one stage; the same command resumes it. Works under torchrun."""

    config: str
    """Recipe: test, small or paper; or a JSON file such as the recipe.json of a run."""
    stage: str
    """Name of the stage, as in the recipe: vae, static-low, dynamic, video_diffusion, joint."""
    out: Path = Path("training-run")
    """Folder of the run, with one subfolder per stage."""
    clips: Path | None = None
    """Folder of shards to train on. Default: the procedural worlds of the recipe."""
    latents: tuple[Path, ...] = ()
    """Folders of encoded clips (prepare latents) for a video_diffusion stage, instead of
    clips."""
    set: Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction] = ()
    """Recipe overrides such as stages.vae.steps=2000 or trainer.parallel=ddp; repeatable."""
    from_model: str | None = None
    """Model folder or name that initialises the parts not trained by earlier stages."""
    features: str | None = None
    """LPIPS weights: vgg:FILE or alex:FILE. Default: a distance without weights."""
    steps: int | None = None
    """Save and stop after this many steps."""
    minutes: float | None = None
    """Save and stop after this many minutes."""
    device: str | None = None
    """Device, such as cpu. Default: a GPU if available."""
    ignore_gates: bool = False
    """Start even if earlier stages are unfinished or below their quality thresholds."""

    def run(self) -> None:
        """Train, then print step and metrics."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer, precompile_sources
        from diff4splat.configs.recipes import find_recipe, with_clips, with_latents
        from diff4splat.training.recipe.overrides import override
        from diff4splat.training.train_stage import StageRequest, is_main_process, train_stage

        self._require_some_work()
        recipe = override(find_recipe(self.config), [one for given in self.set for one in given])
        if self.clips is not None:
            recipe = with_clips(recipe, self.clips)
        if self.latents:
            recipe = with_latents(recipe, self.stage, self.latents)
        recipe.stage(self.stage)
        phases = ConsolePhases()
        precompile_renderer(single_gaussian("cpu"), phases)
        precompile_sources(recipe.stage(self.stage).data.sources, phases)
        request = StageRequest(
            recipe=recipe,
            stage=self.stage,
            folder=self.out,
            features=self.features,
            ignore_gates=self.ignore_gates,
            start=self.starting_model(),
            stop_after_steps=self.steps,
            stop_after_s=None if self.minutes is None else 60 * self.minutes,
            device=self.device,
            phases=phases,
            note=note,
        )
        result = train_stage(request)
        if not is_main_process():
            return
        measures = ", ".join(f"{name} {value:.4g}" for name, value in result.measures.items())
        total = recipe.stage(self.stage).steps
        more = "" if result.outcome == "finished" else "; the same command goes on"
        print(
            f"{self.stage}: step {result.step} of {total} ({measures or 'not evaluated yet'}){more}"
        )

    def starting_model(self) -> "Model | None":
        """The model that stands in for stages that were not run."""
        from diff4splat.models.hub.model import load_model

        if self.from_model is None:
            return None
        return load_model(self.from_model)

    def _require_some_work(self) -> None:
        """Reject limits below one step, before anything is loaded.

        Raises:
            ConfigError: a limit is not above 0.
        """
        for name, limit in (("--steps", self.steps), ("--minutes", self.minutes)):
            if limit is not None and not limit > 0:
                raise ConfigError(
                    f"{name}: expected more than 0, got {limit}; leave it out to finish"
                )
