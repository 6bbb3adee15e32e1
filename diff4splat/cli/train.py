"""``diff4splat train``: train one stage of a recipe, or resume it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.models.hub.pretrained import Model


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train one stage; the same command resumes it. Works under torchrun."""

    config: str
    """Recipe: test, small or paper; or a JSON file such as the recipe.json of a run."""
    stage: str
    """Stage name in the recipe: vae, static-low, dynamic, generator, joint."""
    out: Path = Path("training-run")
    """Folder of the run, with one subfolder per stage."""
    clips: Path | None = None
    """Folder of shards to train on. Default: the procedural worlds of the recipe."""
    latents: tuple[Path, ...] = ()
    """Folders of encoded clips (prepare latents) for a generator stage, instead of clips."""
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
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.cli.installation import single_gaussian
        from diff4splat.cli.renderer import prepare_renderer
        from diff4splat.cli.worlds import prepare_sources
        from diff4splat.configs.recipes import find_recipe, with_clips, with_latents
        from diff4splat.training.recipe_json import changed
        from diff4splat.training.stage_run import StageRun, is_first_process, train_stage

        self._require_some_work()
        recipe = changed(find_recipe(self.config), [one for given in self.set for one in given])
        if self.clips is not None:
            recipe = with_clips(recipe, self.clips)
        if self.latents:
            recipe = with_latents(recipe, self.stage, self.latents)
        recipe.stage(self.stage)
        phases = ConsolePhases()
        prepare_renderer(single_gaussian("cpu"), phases)
        prepare_sources(recipe.stage(self.stage).data.sources, phases)
        asked = StageRun(
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
        result = train_stage(asked)
        if not is_first_process():
            return
        measures = ", ".join(f"{name} {value:.4g}" for name, value in result.measures.items())
        total = recipe.stage(self.stage).steps
        more = "" if result.outcome == "finished" else "; the same command goes on"
        print(f"{self.stage}: step {result.step} of {total} ({measures or 'not judged yet'}){more}")

    def starting_model(self) -> "Model | None":
        """The model for parts that no earlier stage trained."""
        from diff4splat.models.hub.pretrained import load_model, with_text_encoder

        if self.from_model is None:
            return None
        return with_text_encoder(load_model(self.from_model))

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
