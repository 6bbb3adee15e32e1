"""``diff4splat train``: train one stage of a recipe, or resume it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from diff4splat.cli.options.constraints import InputPath, Number, OutFolder
from diff4splat.cli.options.models import FeatureFiles, ModelName

if TYPE_CHECKING:
    from diff4splat.models.hub.model import Model
    from diff4splat.training.recipe.recipe import Recipe


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train one stage; the same command resumes it. Works under torchrun."""

    config: str
    """Recipe: test, small, paper, distil (few steps of the video model), or backbone for an
    imported model (with --from-model); or a JSON file such as the recipe.json of a run."""
    stage: str
    """Stage to train, such as vae; another name is refused with a list of the recipe's stages."""
    out: OutFolder = Path("training-run")
    """Folder of the run, with one subfolder per stage."""
    clips: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
    """Folder of shards to train on, or FOLDER:WEIGHT; repeatable: folders are mixed by weight.
    Default: the procedural worlds of the recipe."""
    commercial_only: bool = False
    """Leave out clips whose licence is not known to allow commercial use."""
    latents: Annotated[
        tuple[Path, ...], InputPath(what="a folder of encoded clips", file=False)
    ] = ()
    """Folders of encoded clips (prepare latents) for a video_diffusion or video_distillation
    stage, instead of clips."""
    set: Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction] = ()
    """Recipe overrides such as stages.vae.steps=2000 or trainer.parallel=ddp; repeatable."""
    from_model: Annotated[str | None, ModelName()] = None
    """Model folder or name that initialises the parts not trained by earlier stages."""
    features: Annotated[str | None, FeatureFiles()] = None
    """LPIPS weights: vgg:FILE or alex:FILE. Default: a distance without weights."""
    steps: Annotated[int | None, Number(above=0)] = None
    """Save and stop after this many steps of this call."""
    minutes: Annotated[float | None, Number(above=0)] = None
    """Save and stop after this many minutes of this call."""
    device: str | None = None
    """Where networks are trained: cpu, cuda, or auto, the default, which is the GPU of each process
    if there is one. Images are then rendered by gsplat."""
    dtype: Literal["float32", "bfloat16"] | None = None
    """What networks compute in; weights stay float32. Default: the recipe's trainer.precision."""
    ignore_gates: bool = False
    """Start even if earlier stages are unfinished or below their quality thresholds."""

    def check(self) -> None:
        """Require a recipe with this stage, and overrides that fit it."""
        self.recipe()

    def run(self) -> None:
        """Train, then print step and metrics."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.common.installation import single_gaussian
        from diff4splat.cli.common.precompile import precompile_renderer, precompile_sources
        from diff4splat.cli.limits.stopwatch import Stopwatch
        from diff4splat.cli.limits.training import promise
        from diff4splat.training.train_stage import StageRequest, is_main_process, train_stage

        recipe, phases = self.recipe(), ConsolePhases()
        promised, watch = promise(self), Stopwatch.of_process()
        for line in promised.lines() if promised else ():
            note(line)
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
            device=None if self.device == "auto" else self.device,
            phases=phases,
            note=note,
        )
        result = train_stage(request)
        if not is_main_process():
            return
        for line in promised.after(watch.read()) if promised else ():
            note(line)
        measures = ", ".join(f"{name} {value:.4g}" for name, value in result.measures.items())
        total = recipe.stage(self.stage).steps
        more = "" if result.outcome == "finished" else "; the same command goes on"
        print(
            f"{self.stage}: step {result.step} of {total} ({measures or 'not evaluated yet'}){more}"
        )

    def recipe(self) -> "Recipe":
        """The recipe with its overrides and data.

        Raises:
            ConfigError: no such recipe, stage or setting.
        """
        from diff4splat.configs.recipes import (
            for_commercial_use,
            with_latents,
            with_mixture,
        )
        from diff4splat.training.recipe.overrides import override

        changes = [one for given in self.set for one in given]
        if self.dtype is not None:
            changes.append(f"trainer.precision={self.dtype}")
        recipe = override(self._base_recipe(), changes)
        if self.clips:
            recipe = with_mixture(recipe, self._folders())
        if self.commercial_only:
            recipe = for_commercial_use(recipe)
        if self.latents:
            recipe = with_latents(recipe, self.stage, self.latents)
        recipe.stage(self.stage)
        return recipe

    def _base_recipe(self) -> "Recipe":
        from diff4splat.configs.public_backbone import BACKBONE, backbone_recipe
        from diff4splat.configs.recipes import find_recipe
        from diff4splat.errors import ConfigError

        if self.config != BACKBONE:
            return find_recipe(self.config)
        if self.from_model is None:
            raise ConfigError(
                "--config backbone: expected --from-model with an imported model, got none; "
                "make one with diff4splat models import"
            )
        from diff4splat.models.hub.folders import find_config

        return backbone_recipe(find_config(self.from_model))

    def _folders(self) -> list[tuple[Path, float]]:
        from diff4splat.configs.recipes import weighted_folder

        folders = [weighted_folder(text) for text in self.clips]
        for folder, _ in folders:
            InputPath(what="a folder of shards", file=False).check("--clips", folder)
        return folders

    def starting_model(self) -> "Model | None":
        """The model that stands in for stages that were not run; weights are read where needed."""
        from diff4splat.models.hub.model import load_model

        if self.from_model is None:
            return None
        return load_model(self.from_model, parts=())
