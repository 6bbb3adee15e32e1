"""Turns placed objects into the objects of a world: textures, instances and quantised meshes.

In a world that must contain a new texture, the first object that can carry it gets it, moving
objects first.
"""

from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.synthetic.layout.floor_plan import PlacedObject
from diff4splat.data_prep.synthetic.materials import MaterialSampler, image_texture
from diff4splat.data_prep.synthetic.motions.context import PartPositions
from diff4splat.data_prep.synthetic.palettes import PALETTES
from diff4splat.data_prep.synthetic.quantise import quantise
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.shape import Part
from diff4splat.data_prep.synthetic.splits import Split
from diff4splat.data_prep.synthetic.world import Mesh, Texture, WorldObject

MAX_OBJECTS = 250


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldContent:
    """All placed objects of a world, before textures."""

    moving: tuple[PlacedObject, ...]
    static: tuple[PlacedObject, ...]
    split: Split
    rng: Rng


@dataclass(frozen=True, slots=True, kw_only=True)
class AssembledObject:
    """A placed object with its instances and textures, for captions and metadata."""

    placed: PlacedObject
    instances: tuple[int, ...]
    textures: tuple[Texture, ...]


def assemble(content: WorldContent) -> tuple[tuple[WorldObject, ...], tuple[AssembledObject, ...]]:
    """World objects in order of their instances, and the placed objects they belong to."""
    palette = PALETTES[content.rng.choice(content.split.palettes.names)]
    sampler = MaterialSampler(
        palette,
        frozenset(content.split.textures.names),
        content.split.textures.new,
        content.rng.child("looks"),
    )
    objects: list[WorldObject] = []
    assembled: list[AssembledObject] = []
    seen_new = False
    for item in (*content.moving, *content.static):
        parts = item.shape.parts
        if len(objects) + len(parts) > MAX_OBJECTS:
            break
        textures = []
        for part, positions in zip(parts, item.parts, strict=True):
            want = not seen_new and bool(content.split.textures.new)
            texture = (
                image_texture(part.image, item.shape.height)
                if part.image is not None
                else sampler.texture(part.role, item.size_m, prefer_wanted=want)
            )
            seen_new = seen_new or texture.family in content.split.textures.new
            textures.append(texture)
            objects.append(object_of(len(objects) + 1, part, positions, texture))
        first = len(objects) - len(parts) + 1
        numbers = tuple(range(first, len(objects) + 1))
        assembled.append(AssembledObject(placed=item, instances=numbers, textures=tuple(textures)))
    return tuple(objects), tuple(assembled)


def object_of(
    instance: int, part: Part, positions: PartPositions | np.ndarray, texture: Texture
) -> WorldObject:
    """A part as an instance, its numbers rounded."""
    rounded = quantise(np.ascontiguousarray(positions, np.float64))
    if len(rounded) > 1 and bool((rounded == rounded[:1]).all()):
        rounded = rounded[:1]
    mesh = Mesh(
        triangles=np.ascontiguousarray(part.surface.triangles, np.int32),
        rest=quantise(np.ascontiguousarray(part.surface.vertices)),
        uv=quantise(np.ascontiguousarray(part.surface.uv)),
        smooth=part.smooth,
    )
    return WorldObject(instance=instance, mesh=mesh, texture=texture, positions=rounded)
