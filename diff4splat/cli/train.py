"""``diff4splat train``: one stage of a recipe, from wherever its folder left off."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train one stage; the same command goes on after any stop. Also under torchrun."""

    config: str
    """Recipe: test, small or paper; or a JSON file such as the recipe.json of a run."""
    stage: str
    """Name of the stage: vae, static-low, static-high, dynamic, generator, joint."""
    out: Path = Path("training-run")
    """Folder of the whole run; every stage has its own folder in it."""
    clips: Path | None = None
    """Folder of shards to learn from; if left out, the worlds that the recipe names."""
    set: tuple[str, ...] = ()
    """Changes such as stages.vae.steps=2000 or trainer.parallel=ddp."""
    features: str | None = None
    """Weights of LPIPS, as vgg:FILE or alex:FILE; if left out, a stand-in without weights."""
    steps: int | None = None
    """Save and stop after so many steps of this call."""
    minutes: float | None = None
    """Save and stop after so many minutes of this call."""
    device: str | None = None
    """Such as cpu; if left out, a GPU if there is one."""
    ignore_gates: bool = False
    """Start although the stages before fell short or are not over."""

    def run(self) -> None:
        """Train, then say how far it came."""
        from diff4splat.cli.console import ConsolePhases, note
        from diff4splat.cli.installation import speck
        from diff4splat.cli.renderer import prepare_renderer
        from diff4splat.configs.recipes import find_recipe, with_clips
        from diff4splat.training.recipe_json import changed
        from diff4splat.training.stage_run import StageRun, train_stage

        recipe = changed(find_recipe(self.config), self.set)
        if self.clips is not None:
            recipe = with_clips(recipe, self.clips)
        recipe.stage(self.stage)
        phases = ConsolePhases()
        prepare_renderer(speck("cpu"), phases)
        asked = StageRun(
            recipe=recipe,
            stage=self.stage,
            folder=self.out,
            features=self.features,
            ignore_gates=self.ignore_gates,
            stop_after_steps=self.steps,
            stop_after_s=None if self.minutes is None else 60 * self.minutes,
            device=self.device,
            phases=phases,
            note=note,
        )
        result = train_stage(asked)
        measures = ", ".join(f"{name} {value:.4g}" for name, value in result.measures.items())
        total = recipe.stage(self.stage).steps
        more = "" if result.outcome == "finished" else "; the same command goes on"
        print(f"{self.stage}: step {result.step} of {total} ({measures or 'not judged yet'}){more}")
