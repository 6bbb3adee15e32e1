"""From placed things to the objects of a world: textures, instances, grids of numbers.

In a world that must show a new texture one thing gets it: the first mover if it can, else any.
"""

from dataclasses import dataclass

import numpy as np

from diff4splat.data_prep.synthetic.draws import Draws
from diff4splat.data_prep.synthetic.layout.plan import Placed
from diff4splat.data_prep.synthetic.materials import Looks
from diff4splat.data_prep.synthetic.motions.act import Posed
from diff4splat.data_prep.synthetic.palettes import PALETTES
from diff4splat.data_prep.synthetic.rounding import to_grid
from diff4splat.data_prep.synthetic.shapes.shape import Part
from diff4splat.data_prep.synthetic.splits import Split
from diff4splat.data_prep.synthetic.world import Mesh, Texture, WorldObject

MOST_OBJECTS = 250


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenery:
    """All that is in a world, before it gets its colours."""

    moving: tuple[Placed, ...]
    standing: tuple[Placed, ...]
    split: Split
    draws: Draws


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """A thing with its look: what notes and captions speak of."""

    placed: Placed
    instances: tuple[int, ...]
    textures: tuple[Texture, ...]


def assemble(scenery: Scenery) -> tuple[tuple[WorldObject, ...], tuple[Named, ...]]:
    """Objects in the order of their instances, and who they belong to."""
    palette = PALETTES[scenery.draws.pick(scenery.split.palettes.names)]
    looks = Looks(
        palette,
        frozenset(scenery.split.textures.names),
        scenery.split.textures.new,
        scenery.draws.child("looks"),
    )
    objects: list[WorldObject] = []
    named: list[Named] = []
    seen_new = False
    for thing in (*scenery.moving, *scenery.standing):
        parts = thing.shape.parts
        if len(objects) + len(parts) > MOST_OBJECTS:
            break
        textures = []
        for part, positions in zip(parts, thing.parts, strict=True):
            want = not seen_new and bool(scenery.split.textures.new)
            texture = looks.texture(part.role, thing.size_m, prefer_wanted=want)
            seen_new = seen_new or texture.family in scenery.split.textures.new
            textures.append(texture)
            objects.append(_object(len(objects) + 1, part, positions, texture))
        first = len(objects) - len(parts) + 1
        numbers = tuple(range(first, len(objects) + 1))
        named.append(Named(placed=thing, instances=numbers, textures=tuple(textures)))
    return tuple(objects), tuple(named)


def _object(
    instance: int, part: Part, positions: Posed | np.ndarray, texture: Texture
) -> WorldObject:
    rounded = to_grid(np.ascontiguousarray(positions, np.float64))
    if len(rounded) > 1 and bool((rounded == rounded[:1]).all()):
        rounded = rounded[:1]
    mesh = Mesh(
        triangles=np.ascontiguousarray(part.surface.triangles, np.int32),
        rest=to_grid(np.ascontiguousarray(part.surface.vertices)),
        uv=to_grid(np.ascontiguousarray(part.surface.uv)),
        smooth=part.smooth,
    )
    return WorldObject(instance=instance, mesh=mesh, texture=texture, positions=rounded)
