"""What each variant leaves out or exchanges, as changes of one recipe.

    vae (trained before) ─ static-low, S steps ─ motion, M steps ─ dynamic, D steps

All three run at the size of ``static-low``. Their names stay the same in every variant, because
samples follow from names: all variants see the same clips and targets in the same order.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from diff4splat.errors import ConfigError
from diff4splat.training.recipe.overrides import override
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe

AUTOENCODER, STATIC, MOTION, DYNAMIC = "vae", "static-low", "motion", "dynamic"
STAGES = (STATIC, MOTION, DYNAMIC)
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
    without: tuple[str, ...] = ()
    """Stages left out; the dynamic stage gets their processor time."""
    deforms: bool = True
    """False: the dynamic stage has no deformation network."""
    use_ground_truth_frames: bool = False
    """Evaluated with the given images as they are, not as the autoencoder decodes them."""


def _each(stages: tuple[str, ...], change: str) -> tuple[str, ...]:
    return tuple(f"stages.{stage}.{change}" for stage in stages)


def _rendering(change: str) -> tuple[str, ...]:
    """A change of a loss weight in the stages that render."""
    dynamic = f"stages.{DYNAMIC}.losses.reconstruction.{change}"
    return f"stages.{STATIC}.losses.{change}", dynamic


FULL = Variant(name="full", title="full")
VARIANTS = (
    FULL,
    Variant(
        name="no-motion-loss",
        title="no motion loss",
        # The motion stage has no other loss to learn from.
        without=(MOTION,),
        changes=(f"stages.{DYNAMIC}.losses.motion.weight=0",),
    ),
    Variant(
        name="no-deformation",
        title="no deformation",
        without=(MOTION,),
        deforms=False,
    ),
    Variant(
        name="no-depth-correlation",
        title="no depth correlation, nor smoothness",
        changes=_rendering("depth=0"),
    ),
    Variant(
        name="no-depth-loss",
        title="no depth loss at all",
        changes=(*_rendering("depth=0"), *_rendering("depth_log=0")),
    ),
    Variant(name="no-motion-stage", title="no motion stage", without=(MOTION,)),
    Variant(name="no-order", title="no order of stages", without=(STATIC, MOTION)),
    Variant(
        name="pictures",
        title="true pictures instead of latents",
        changes=("model.ldrm.input=frames", *_each(STAGES, "use_ground_truth_frames=true")),
        use_ground_truth_frames=True,
    ),
    Variant(
        name="no-comparison",
        title="no comparison of frames",
        changes=("model.refinement.cost_volume_depths=0",),
    ),
    Variant(
        name="no-surroundings",
        title="no surroundings",
        changes=("model.refinement.border_cells=0",),
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


def reduced(recipe: Recipe, steps: Mapping[str, int]) -> Recipe:
    """The stages of all variants, at one size and without gates or evaluations.

    ``steps`` has those of the full variant by stage. Samples are made in the training process, so
    that its seconds are all there is to count.

    Raises:
        ConfigError: the recipe lacks a stage, or steps are not at least 1.
    """
    names = [stage.name for stage in recipe.stages]
    if missing := [name for name in (AUTOENCODER, *STAGES) if name not in names]:
        raise ConfigError(
            f"--config: expected a recipe with stages {', '.join((AUTOENCODER, *STAGES))}, got "
            f"{recipe.name!r} without {', '.join(missing)}; choose another"
        )
    size_px = recipe.stage(STATIC).data.size_px
    later = [
        replace(stage, gates=(), data=replace(stage.data, size_px=size_px, workers=0))
        for stage in map(recipe.stage, STAGES)
    ]
    trainer = replace(recipe.trainer, evaluation_samples=0, keep_checkpoints=1)
    whole = replace(recipe, stages=(recipe.stage(AUTOENCODER), *later), trainer=trainer)
    for name in STAGES:
        whole = with_steps(whole, name, steps[name])
    return whole


def with_steps(recipe: Recipe, stage: str, steps: int) -> Recipe:
    """The recipe with another length of one stage, and a warm-up that fits it.

    Raises:
        ConfigError: not at least one step.
    """
    own = recipe.stage(stage)
    warm_up = replace(own.optimizer, warmup_steps=round(WARM_UP_SHARE * steps))
    return _exchanged(recipe, replace(own, steps=steps, optimizer=warm_up))


def recipe_of(variant: Variant, base: Recipe) -> Recipe:
    """The recipe of a variant: steps of the full one, with those left out added to the last stage.

    Raises:
        ConfigError: the base cannot be changed like that.
    """
    try:
        recipe = override(base, variant.changes)
    except ConfigError as error:
        raise ConfigError(f"variant {variant.name}: {error}; choose others with --only") from error
    if not variant.without:
        return recipe
    dynamic = recipe.stage(DYNAMIC)
    if not variant.deforms:
        dynamic = _without_deformation(dynamic)
    if STATIC in variant.without:
        # What starts from nothing learns at the rate of what starts from nothing.
        dynamic = replace(dynamic, optimizer=recipe.stage(STATIC).optimizer)
    steps = sum(recipe.stage(name).steps for name in (*variant.without, DYNAMIC))
    kept = tuple(stage for stage in recipe.stages if stage.name not in variant.without)
    return with_steps(_exchanged(replace(recipe, stages=kept), dynamic), DYNAMIC, steps)


def _without_deformation(dynamic: StageRecipe) -> StageRecipe:
    """A static stage on the data of the dynamic one."""
    losses = dynamic.losses.reconstruction
    return replace(dynamic, kind="static", trained=("ldrm",), losses=losses)


def trained_stages(recipe: Recipe) -> tuple[str, ...]:
    """Names of the stages that a variant trains."""
    return tuple(stage.name for stage in recipe.stages if stage.name in STAGES)


def paid_by(recipe: Recipe, stage: str) -> tuple[str, ...]:
    """The stages of the full variant whose seconds a stage of this recipe may take.

    Its own, and for the dynamic stage those of the stages that are left out as well.
    """
    left_out = set(STAGES) - set(trained_stages(recipe)) if stage == DYNAMIC else set()
    return tuple(name for name in STAGES if name == stage or name in left_out)


def _exchanged(recipe: Recipe, stage: StageRecipe) -> Recipe:
    stages = [stage if old.name == stage.name else old for old in recipe.stages]
    return replace(recipe, stages=tuple(stages))
