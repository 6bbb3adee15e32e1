"""An endless source of dynamic worlds: ``make_world(recipe, index)``.

World number ``index`` is a function of the recipe and the index alone, on every machine and in
every process. A world that does not come out well (nobody is seen moving, or a held-out world shows
nothing new) is drawn again from (index, attempt).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from diff4splat.data_prep.synthetic.action import Stage, frozen, movers
from diff4splat.data_prep.synthetic.assembly import Scenery, assemble
from diff4splat.data_prep.synthetic.cameras import Lens, draw_path, draw_shots, film
from diff4splat.data_prep.synthetic.cast import Cast
from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.layout.plan import Placed, Plan
from diff4splat.data_prep.synthetic.lights import lighting
from diff4splat.data_prep.synthetic.narration import facts_of, note_of
from diff4splat.data_prep.synthetic.rig import rig_shots
from diff4splat.data_prep.synthetic.rounding import POSE_BITS, to_grid
from diff4splat.data_prep.synthetic.splits import Split, SplitName, load_split
from diff4splat.data_prep.synthetic.surroundings import Surroundings, furnish
from diff4splat.data_prep.synthetic.world import World
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera

ATTEMPTS = 60
FPS = 8.0
Names = tuple[str, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldRecipe:
    """Which worlds to make. The names narrow the split's lists; None leaves them as they are."""

    seed: int = 0
    split: SplitName = "training"
    still_share: float = 0.15
    """Share of worlds in which only the camera moves."""
    against_share: float = 0.0
    """Share of travelling things that go against what their place and facing suggest."""
    frozen_share: float = 0.0
    """Share of the other worlds in which what could move stands all the same."""
    frames: int = 17
    size_px: tuple[int, int] = (128, 128)
    """(height, width)"""
    views: int = 3
    fps: float = FPS
    """17 frames make 2 seconds."""
    rig: bool = False
    """Cameras stand all around the stage; otherwise each goes its own way near the input view."""
    families: Names = None
    textures: Names = None
    motions: Names = None
    palettes: Names = None
    scenes: Names = None

    def __post_init__(self) -> None:
        _require_range("frames", self.frames, 2, 1000)
        _require_range("views", self.views, 4 if self.rig else 1, 64 if self.rig else 8)
        _require_range("size_px", min(self.size_px), 8, 4096)
        _require_range("size_px", max(self.size_px), 8, 4096)
        for name in ("still_share", "against_share", "frozen_share"):
            _require_range(name, getattr(self, name), 0.0, 1.0)
        _require_range("fps", self.fps, 0.1, 1000.0)

    def allowed(self) -> Split:
        """The split's lists, narrowed.

        Raises:
            ConfigError: a name that the split does not have.
        """
        full = load_split(self.split)
        return Split(
            families=full.families.only(self.families, "families"),
            textures=full.textures.only(self.textures, "textures"),
            motions=full.motions.only(self.motions, "motions"),
            palettes=full.palettes.only(self.palettes, "palettes"),
            scenes=full.scenes.only(self.scenes, "scenes"),
        )


def make_world(recipe: WorldRecipe, index: int) -> World:
    """World number ``index``.

    Raises:
        ConfigError: the recipe names what its split does not have, or what never comes together,
            such as a motion that none of its families can do.
    """
    _require_range("index", index, 0, 2**62)
    split = recipe.allowed()
    for attempt in range(ATTEMPTS):
        draws = Draws("world", recipe.split, recipe.seed, index, attempt)
        is_still = Draws("still", recipe.split, recipe.seed, index).chance(recipe.still_share)
        world = _try_world(recipe, index, split, draws, is_still)
        if world is not None:
            return world
    raise ConfigError(
        f"world {index}: expected a scene in which the recipe's families and motions fit, got none "
        f"in {ATTEMPTS} attempts; allow more families, motions or scenes"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Framing:
    """Where a world happens and who looks at it."""

    cast: Cast
    stage: Stage
    views: tuple[Camera, ...]
    path: str
    """Of the input view."""


def _try_world(
    recipe: WorldRecipe, index: int, split: Split, draws: Draws, is_still: bool
) -> World | None:
    framing = _framing(recipe, split, draws, is_still)
    if framing is None:
        return None
    cast, stage = framing.cast, framing.stage
    moving = _moving(stage, draws, is_still)
    if not is_still and not moving:
        return None
    around = Surroundings(
        cast=cast, stage_m=stage.radius_m, plan=stage.plan, draws=draws.child("around")
    )
    standing = furnish(around)
    if draws.child("frozen").chance(recipe.frozen_share):
        moving, standing = [], [*map(frozen, moving), *standing]
    scenery = Scenery(
        moving=tuple(moving),
        standing=tuple(standing),
        split=split,
        draws=draws.child("looks"),
    )
    objects, named = assemble(scenery)
    if not _shows_something_new(split, scenery, objects):
        return None
    light, sky = lighting(SCENE_KINDS[cast.scene], stage.radius_m, draws.child("light"))
    facts = facts_of(cast.scene, named, framing.views[0], framing.path, draws.child("facts"))
    return World(
        note=note_of(
            facts, named, world_identifier(recipe, index), draws.child("words").integer(0, 11)
        ),
        times_s=to_grid(stage.times_s, POSE_BITS),
        objects=objects,
        light=light,
        sky=sky,
        views=framing.views,
    )


def _framing(recipe: WorldRecipe, split: Split, draws: Draws, is_still: bool) -> _Framing | None:
    """Scene, stage and cameras; None when nothing could move there or a camera would be too low."""
    names = split.scenes.names
    scene = draws.weighted(names, [SCENE_KINDS[name].weight for name in names])
    cast, kind = Cast(split=split, scene=scene), SCENE_KINDS[scene]
    if not is_still and not cast.pairs():
        return None
    radius = math.exp(draws.between(*(math.log(limit) for limit in kind.stage_m)))
    fov_deg = draws.between(35.0, 72.0)
    lens = Lens(size_px=recipe.size_px, fov_deg=fov_deg, frames=recipe.frames, fps=recipe.fps)
    arrange = rig_shots if recipe.rig else draw_shots
    shots = arrange(kind, lens, radius, recipe.views, draws.child("shots"))
    if is_still and not recipe.rig:
        shots[0] = replace(shots[0], path=draw_path(draws.child("path"), may_stand=False))
    views = tuple(film(shot, lens, 0.28 * radius) for shot in shots)
    eyes = np.concatenate([view.position.numpy() for view in views])
    if float(eyes[:, 1].max()) > -0.1 * radius:
        return None
    distance = shots[0].distance_m
    stage = Stage(
        radius_m=radius,
        times_s=np.arange(recipe.frames) / recipe.fps,
        camera=views[0],
        distance_m=distance,
        plan=Plan(eyes=eyes, margin_m=0.16 * distance),
        cast=cast,
        against_share=recipe.against_share,
    )
    return _Framing(cast=cast, stage=stage, views=views, path=shots[0].path)


def _moving(stage: Stage, draws: Draws, is_still: bool) -> list[Placed]:
    """What moves; where nothing does, the middle of the stage is kept in sight all the same."""
    if is_still:
        radius = stage.radius_m
        stage.plan.watched.append((0.0, 0.3 * radius, 0.0, 0.4 * radius))
        return []
    count = draws.weighted((1, 2, 3), (5.0, 4.0, 2.0))
    return movers(stage, count, draws.child("act"))


def world_identifier(recipe: WorldRecipe, index: int) -> str:
    """What the clip of a world is called."""
    rig = f"-rig{recipe.views}" if recipe.rig else ""
    return f"worlds-v1-{recipe.split}-{recipe.seed}-{index:08d}{rig}"


def _shows_something_new(split: Split, scenery: Scenery, objects) -> bool:
    """Whether a held-out world has what training worlds lack; others always do."""
    things = [*scenery.moving, *scenery.standing]
    families = {thing.family for thing in things}
    motions = {thing.motion for thing in scenery.moving}
    textures = {thing.texture.family for thing in objects}
    wanted = [(split.families.new, families), (split.textures.new, textures)]
    if scenery.moving:
        wanted.append((split.motions.new, motions))
    return all(not new or new & seen for new, seen in wanted)


def _require_range(what: str, value: float | int, low: float | int, high: float | int) -> None:
    if not low <= value <= high:
        raise ConfigError(
            f"{what}: expected {low:g} to {high:g}, got {value:g}; choose another value"
        )
