"""What each variant leaves out or exchanges, as changes of one recipe.

    vae (trained before) ─ static-low, S steps ─ dynamic, D steps

Both stages run at the size of ``static-low``. Their names stay the same in every variant, because
samples follow from names: all variants see the same clips and targets in the same order.
"""

from dataclasses import dataclass, replace

from diff4splat.errors import ConfigError
from diff4splat.training.recipe import Recipe, StageRecipe
from diff4splat.training.recipe_json import changed

AUTOENCODER, STATIC, DYNAMIC = "vae", "static-low", "dynamic"
STAGES = (STATIC, DYNAMIC)
WARM_UP_SHARE = 0.1
"""Of a stage's steps: the warm-up of a whole training would fill most of a short one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One row of the table."""

    name: str
    """Of its folder, and for ``--only``."""
    title: str
    changes: tuple[str, ...] = ()
    """As ``--set`` of the training command takes them."""
    ordered: bool = True
    """False: motion is learnt from the start, in the time of both stages."""
    true_pictures: bool = False
    """Judged with the given pictures as they are, not as the autoencoder decodes them."""


def _both(change: str) -> tuple[str, ...]:
    return tuple(f"stages.{stage}.{change}" for stage in STAGES)


FULL = Variant(name="full", title="full")
VARIANTS = (
    FULL,
    Variant(
        name="no-motion-loss",
        title="no motion loss",
        changes=(f"stages.{DYNAMIC}.losses.motion=0",),
    ),
    Variant(
        name="no-deformation",
        title="no deformation",
        changes=(f"stages.{DYNAMIC}.kind=static", f'stages.{DYNAMIC}.trained=["ldrm"]'),
    ),
    Variant(
        name="no-depth-correlation",
        title="no depth correlation, nor smoothness",
        changes=_both("losses.depth=0"),
    ),
    Variant(
        name="no-depth-loss",
        title="no depth loss at all",
        changes=(*_both("losses.depth=0"), *_both("losses.depth_log=0")),
    ),
    Variant(name="no-order", title="no order of stages", ordered=False),
    Variant(
        name="pictures",
        title="true pictures instead of latents",
        changes=("model.ldrm.reads=frames", *_both("true_pictures=true")),
        true_pictures=True,
    ),
    Variant(
        name="no-comparison",
        title="no comparison of frames",
        changes=("model.detail.depths=0",),
    ),
    Variant(
        name="no-surroundings",
        title="no surroundings",
        changes=("model.detail.surroundings=0",),
    ),
)


def chosen_variants(only: tuple[str, ...]) -> tuple[Variant, ...]:
    """The named ones in the order of the table, all without names; always with the full one.

    Raises:
        ConfigError: a name is unknown.
    """
    known = [variant.name for variant in VARIANTS]
    for name in only:
        if name not in known:
            raise ConfigError(f"--only: expected names among {', '.join(known)}, got {name!r}")
    wanted = {*(only or known), FULL.name}
    return tuple(variant for variant in VARIANTS if variant.name in wanted)


def reduced(recipe: Recipe, static_steps: int, dynamic_steps: int) -> Recipe:
    """The stages of all variants, at one size and without gates or evaluations.

    Samples are made in the training process, so that its seconds are all there is to count.

    Raises:
        ConfigError: the recipe lacks a stage, or steps are not at least 1.
    """
    static, dynamic = recipe.stage(STATIC), recipe.stage(DYNAMIC)
    dynamic = replace(dynamic, data=replace(dynamic.data, size_px=static.data.size_px))
    later = [
        replace(stage, gates=(), data=replace(stage.data, workers=0)) for stage in (static, dynamic)
    ]
    trainer = replace(recipe.trainer, evaluation_samples=0, keep_checkpoints=1)
    whole = replace(recipe, stages=(recipe.stage(AUTOENCODER), *later), trainer=trainer)
    return with_steps(with_steps(whole, STATIC, static_steps), DYNAMIC, dynamic_steps)


def with_steps(recipe: Recipe, stage: str, steps: int) -> Recipe:
    """The recipe with another length of one stage, and a warm-up that fits it.

    Raises:
        ConfigError: not at least one step.
    """
    own = recipe.stage(stage)
    warm_up = replace(own.optimizer, warmup_steps=round(WARM_UP_SHARE * steps))
    return _exchanged(recipe, replace(own, steps=steps, optimizer=warm_up))


def recipe_of(variant: Variant, base: Recipe) -> Recipe:
    """The recipe of a variant; each stage has the steps of the full one, both where it is one.

    Raises:
        ConfigError: the base cannot be changed like that.
    """
    try:
        recipe = changed(base, variant.changes)
    except ConfigError as error:
        raise ConfigError(f"variant {variant.name}: {error}; choose others with --only") from error
    if variant.ordered:
        return recipe
    static, dynamic = recipe.stage(STATIC), recipe.stage(DYNAMIC)
    # What starts from nothing learns at the rate of what starts from nothing.
    dynamic = replace(dynamic, optimizer=static.optimizer)
    alone = replace(recipe, stages=tuple(stage for stage in recipe.stages if stage != static))
    return with_steps(_exchanged(alone, dynamic), DYNAMIC, static.steps + dynamic.steps)


def trained_stages(recipe: Recipe) -> tuple[str, ...]:
    """Names of the stages that a variant trains."""
    return tuple(stage.name for stage in recipe.stages if stage.name in STAGES)


def paid_by(recipe: Recipe, stage: str) -> tuple[str, ...]:
    """The stages of the full variant whose seconds a stage of this recipe may take."""
    return (stage,) if set(trained_stages(recipe)) == set(STAGES) else STAGES


def _exchanged(recipe: Recipe, stage: StageRecipe) -> Recipe:
    stages = [stage if old.name == stage.name else old for old in recipe.stages]
    return replace(recipe, stages=tuple(stages))
