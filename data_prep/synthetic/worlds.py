"""Procedural dynamic worlds: ``make_world(recipe, index)``.

A world depends on the recipe and the index alone, on every machine and in every process. An
unsuitable world (no visible motion, or a held-out world without new content) is sampled again from
(index, attempt).
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from diff4splat.data_prep.synthetic.actors import StageArea, freeze, place_moving_objects
from diff4splat.data_prep.synthetic.arrangements.arrangement import FOV_DEG, try_arrangement
from diff4splat.data_prep.synthetic.assembly import WorldContent, assemble
from diff4splat.data_prep.synthetic.camera_rig import rig_views
from diff4splat.data_prep.synthetic.cameras import LensSpec, camera_batch, sample_path, sample_views
from diff4splat.data_prep.synthetic.captioning import caption_facts, clip_metadata
from diff4splat.data_prep.synthetic.environment import EnvironmentContext, furnish_environment
from diff4splat.data_prep.synthetic.free_cameras import free_views
from diff4splat.data_prep.synthetic.layout.floor_plan import FloorPlan, PlacedObject
from diff4splat.data_prep.synthetic.layout.kinds import SCENE_KINDS
from diff4splat.data_prep.synthetic.lights import sample_lighting
from diff4splat.data_prep.synthetic.meshes.library import open_library
from diff4splat.data_prep.synthetic.object_sampler import ObjectSampler
from diff4splat.data_prep.synthetic.quantise import POSE_BITS, quantise
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.splits import Split, SplitName, load_split
from diff4splat.data_prep.synthetic.world import World
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import Camera

ATTEMPTS = 60
FPS = 8.0
SHARES = (
    "still_share", "against_share", "frozen_share", "composite_share", "person_share",
    "mesh_share", "furnished_share",
)  # fmt: skip
Names = tuple[str, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldRecipe:
    """Distribution of worlds. Names restrict the lists of the split; None allows the full list."""

    seed: int = 0
    split: SplitName = "training"
    still_share: float = 0.15
    """Share of worlds in which only the camera moves."""
    against_share: float = 0.0
    """Share of travelling objects that move against what their position and orientation suggest."""
    frozen_share: float = 0.0
    """Share of the other worlds whose movable objects are static."""
    frames: int = 17
    size_px: tuple[int, int] = (128, 128)
    """(height, width)"""
    views: int = 3
    fps: float = FPS
    """17 frames make 2 seconds."""
    rig: bool = False
    """Static cameras all around the scene; otherwise moving cameras near the input view."""
    free_cameras: bool = False
    """Static cameras of all kinds beside the input view; for depth of single images."""
    arrangements: bool = False
    """Static objects before a surface, a corner, a room or open ground, seen from any side."""
    composite_share: float = 0.0
    """Share of objects that are random shapes without a name."""
    person_share: float = 0.0
    """Of the others, the share that are people without a name."""
    meshes: Path | None = None
    """A mesh library (``meshes/library.py``), for arrangements."""
    mesh_share: float = 0.0
    """Share of objects that come from ``meshes``."""
    furnished_share: float = 0.0
    """Share of arrangements that are furnished with ``meshes`` at natural size."""
    families: Names = None
    textures: Names = None
    motions: Names = None
    palettes: Names = None
    scenes: Names = None

    def __post_init__(self) -> None:
        _require_range("frames", self.frames, 1, 1000)
        _require_range("views", self.views, 4 if self.rig else 1, 64 if self.rig else 8)
        _require_range("size_px", min(self.size_px), 8, 4096)
        _require_range("size_px", max(self.size_px), 8, 4096)
        for name in SHARES:
            _require_range(name, getattr(self, name), 0.0, 1.0)
        _require_range("fps", self.fps, 0.1, 1000.0)
        if self.rig + self.free_cameras + self.arrangements > 1:
            raise ConfigError(
                "cameras: expected one of rig, free_cameras and arrangements, got several; keep one"
            )

        shares = self.mesh_share + self.furnished_share
        if (self.meshes is None) != (shares == 0.0) or (self.meshes and not self.arrangements):
            raise ConfigError(
                "meshes: expected arrangements with a mesh library and a share above 0, or "
                "neither, got one without the others"
            )

    def allowed(self) -> Split:
        """The lists of the split, restricted to the recipe.

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
            composite_share=self.composite_share,
            person_share=self.person_share,
            meshes=None if self.meshes is None else open_library(self.meshes),
            mesh_share=self.mesh_share,
            furnished_share=self.furnished_share,
        )


def make_world(recipe: WorldRecipe, index: int) -> World:
    """World number ``index``.

    Raises:
        ConfigError: the recipe contains a name outside its split, or an impossible combination,
            such as a motion that none of its families can perform.
    """
    _require_range("index", index, 0, 2**62)
    split = recipe.allowed()
    for attempt in range(ATTEMPTS):
        rng = Rng("world", recipe.split, recipe.seed, index, attempt)
        is_still = Rng("still", recipe.split, recipe.seed, index).bernoulli(recipe.still_share)
        try_world = _try_arrangement if recipe.arrangements else _try_world
        world = try_world(recipe, index, split, rng, is_still)
        if world is not None:
            return world
    raise ConfigError(
        f"world {index}: expected a scene in which the recipe's families and motions fit, got none "
        f"in {ATTEMPTS} attempts; allow more families, motions or scenes"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Framing:
    """Scene, area and cameras of a world."""

    sampler: ObjectSampler
    area: StageArea
    views: tuple[Camera, ...]
    path: str
    """Camera path of the input view."""


def _try_arrangement(
    recipe: WorldRecipe, index: int, split: Split, rng: Rng, is_still: bool
) -> World | None:
    lens = LensSpec(size_px=recipe.size_px, fov_deg=FOV_DEG, frames=recipe.frames, fps=recipe.fps)
    return try_arrangement(split, lens, recipe.views, rng, world_identifier(recipe, index))


def _try_world(
    recipe: WorldRecipe, index: int, split: Split, rng: Rng, is_still: bool
) -> World | None:
    framing = _framing(recipe, split, rng, is_still)
    if framing is None:
        return None
    sampler, area = framing.sampler, framing.area
    moving = _moving(area, rng, is_still, is_watched=not recipe.free_cameras)
    if not is_still and not moving:
        return None
    context = EnvironmentContext(
        sampler=sampler, area_radius_m=area.radius_m, plan=area.plan, rng=rng.child("around")
    )
    static = furnish_environment(context)
    if rng.child("frozen").bernoulli(recipe.frozen_share):
        moving, static = [], [*map(freeze, moving), *static]
    content = WorldContent(
        moving=tuple(moving),
        static=tuple(static),
        split=split,
        rng=rng.child("looks"),
    )
    objects, assembled = assemble(content)
    if not _has_new_content(split, content, objects):
        return None
    light, sky = sample_lighting(SCENE_KINDS[sampler.scene], area.radius_m, rng.child("light"))
    facts = caption_facts(
        sampler.scene, assembled, framing.views[0], framing.path, rng.child("facts")
    )
    return World(
        note=clip_metadata(
            facts, assembled, world_identifier(recipe, index), rng.child("words").integer(0, 11)
        ),
        times_s=quantise(area.times_s, POSE_BITS),
        objects=objects,
        light=light,
        sky=sky,
        views=framing.views,
    )


def _framing(recipe: WorldRecipe, split: Split, rng: Rng, is_still: bool) -> _Framing | None:
    """Sample scene, area and cameras; None if no motion is possible or a camera is too low."""
    names = split.scenes.names
    scene = rng.weighted_choice(names, [SCENE_KINDS[name].weight for name in names])
    sampler, kind = ObjectSampler(split=split, scene=scene), SCENE_KINDS[scene]
    if not is_still and not sampler.motion_pairs():
        return None
    radius = rng.log_uniform(*kind.area_radius_m)
    fov_deg = rng.uniform(35.0, 72.0)
    lens = LensSpec(size_px=recipe.size_px, fov_deg=fov_deg, frames=recipe.frames, fps=recipe.fps)
    arrange = rig_views if recipe.rig else free_views if recipe.free_cameras else sample_views
    specs = arrange(kind, lens, radius, recipe.views, rng.child("shots"))
    if is_still and not (recipe.rig or recipe.free_cameras):
        specs[0] = replace(specs[0], path=sample_path(rng.child("path"), may_be_static=False))
    views = tuple(camera_batch(spec, lens, 0.28 * radius) for spec in specs)
    eyes = np.concatenate([view.position.numpy() for view in views])
    if float(eyes[:, 1].max()) > -0.1 * radius:
        return None
    distance = specs[0].distance_m
    area = StageArea(
        radius_m=radius,
        times_s=np.arange(recipe.frames) / recipe.fps,
        camera=views[0],
        distance_m=distance,
        plan=FloorPlan(eyes=eyes, margin_m=0.16 * distance),
        sampler=sampler,
        against_share=recipe.against_share,
    )
    return _Framing(sampler=sampler, area=area, views=views, path=specs[0].path)


def _moving(area: StageArea, rng: Rng, is_still: bool, *, is_watched: bool) -> list[PlacedObject]:
    """The moving objects; a static world keeps the centre of the area visible instead."""
    if is_still:
        radius = area.radius_m
        if is_watched:
            area.plan.watched.append((0.0, 0.3 * radius, 0.0, 0.4 * radius))
        return []
    count = rng.weighted_choice((1, 2, 3), (5.0, 4.0, 2.0))
    return place_moving_objects(area, count, rng.child("act"))


def world_identifier(recipe: WorldRecipe, index: int) -> str:
    """Identifier of the clip of a world."""
    kind = f"-rig{recipe.views}" if recipe.rig else "-free" if recipe.free_cameras else ""
    kind = "-arranged" if recipe.arrangements else kind
    kind += f"-composite{round(100 * recipe.composite_share)}" if recipe.composite_share else ""
    kind += f"-person{round(100 * recipe.person_share)}" if recipe.person_share else ""
    if recipe.meshes is not None:
        shares = f"{round(100 * recipe.mesh_share)}-{round(100 * recipe.furnished_share)}"
        kind += f"-mesh{shares}-{open_library(recipe.meshes).digest}"
    return f"worlds-v1-{recipe.split}-{recipe.seed}-{index:08d}{kind}"


def _has_new_content(split: Split, content: WorldContent, objects) -> bool:
    """Whether a held-out world has content absent from training; true for training worlds."""
    placed = [*content.moving, *content.static]
    families = {item.family for item in placed}
    motions = {item.motion for item in content.moving}
    textures = {item.texture.family for item in objects}
    wanted = [(split.families.new, families), (split.textures.new, textures)]
    if content.moving:
        wanted.append((split.motions.new, motions))
    return all(not new or new & seen for new, seen in wanted)


def _require_range(what: str, value: float | int, low: float | int, high: float | int) -> None:
    if not low <= value <= high:
        raise ConfigError(
            f"{what}: expected {low:g} to {high:g}, got {value:g}; choose another value"
        )
