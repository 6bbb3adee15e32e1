"""What a procedural world is made of, before anything is drawn.

Axes: ``t`` frames, ``v`` vertices, ``f`` triangles, ``k`` colours. Metres and seconds. World axes
are OpenCV's: x right, y down, z forward, so up is −y and the ground lies near y = 0. Colours are
linear light. Everything is a triangle mesh whose vertices are known at every frame, so that depth,
masks, flow and tracks are exact whatever moves: rigid, jointed or soft. All numbers are rounded to
a grid when a world is made, hence equal on every machine even where a sine is not.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, UInt8

from diff4splat.data.clip import ClipMetadata
from diff4splat.geometry.camera import Camera


@dataclass(frozen=True, slots=True, kw_only=True)
class Texture:
    """A procedural pattern, or an image; families in ``textures``."""

    family: str
    colors: Float64[np.ndarray, "k 3"]
    """Two to four linear RGB colours; their roles belong to the family."""
    scale: float
    """Features per metre."""
    seed: int
    """32 bits that shift and vary the pattern."""
    solid: bool = False
    """True: looked up at the rest position (wood, marble); False: at ``uv`` (brick, fabric)."""
    relief: float = 0.0
    """Height of the pattern in metres per unit of texture value: bends normals, not the shape."""
    gloss: float = 0.0
    """Strength of the highlight, 0 to 1."""
    image: UInt8[np.ndarray, "s s 3"] | None = None
    """sRGB, of family ``image`` alone; a feature is one repeat of it."""
    main_color: str = ""
    """Of an object with images: the name of its main colour; empty for several."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Triangles with what textures hang on."""

    triangles: Int32[np.ndarray, "f 3"]
    rest: Float64[np.ndarray, "v 3"]
    """Positions before any motion, for solid textures; metres."""
    uv: Float64[np.ndarray, "v 2"]
    """Metres along the surface."""
    smooth: bool
    """Shade with vertex normals; vertices of sharp edges are doubled by whoever made the mesh."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldObject:
    """One instance."""

    instance: int
    """1 to 254, unique in its world; parts of the room are instances too."""
    mesh: Mesh
    texture: Texture
    positions: Float64[np.ndarray, "s v 3"]
    """World positions per frame; ``s`` is 1 for static objects, else t."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """One main light with shadows, and light from all around."""

    color: Float64[np.ndarray, " 3"]
    toward: Float64[np.ndarray, " 3"]
    """Unit vector from the world to the light: the sun, or a lamp far enough to be one."""
    sky: Float64[np.ndarray, " 3"]
    """Light from above, on what faces up."""
    ground: Float64[np.ndarray, " 3"]
    """Light from below."""
    softness: float = 0.0
    """Angular radius of the light in radians: widens shadow edges with distance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """What rays see that meet nothing."""

    zenith: Float64[np.ndarray, " 3"]
    horizon: Float64[np.ndarray, " 3"]
    clouds: float
    """Share of the sky under clouds, 0 to 1."""
    haze_per_m: float
    """Light from far surfaces fades into the horizon's colour at this rate."""
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """A scene over time with the cameras that look at it."""

    note: ClipMetadata
    times_s: Float64[np.ndarray, " t"]
    objects: tuple[WorldObject, ...]
    light: Light
    sky: Sky
    views: tuple[Camera, ...]
    """Batches of shape (t,), float64, one image size; the first is the input view."""
