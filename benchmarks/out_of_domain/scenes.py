"""Random scenes for Mitsuba: interiors, table tops, open ground, objects in front of a wall.

Lengths are metres, +y is up. ``textures`` are images with values in [0, 1].
"""

from collections.abc import Callable
from typing import Any

import numpy as np

SHAPES = ("sphere", "cube", "cylinder", "disk")
KINDS = ("interior", "table", "open", "wall", "close")
Description = dict[str, Any]


def random_scene(rng: np.random.Generator, textures: list[np.ndarray], side_px: int) -> Description:
    """One scene with its camera; equal generators give equal scenes."""
    kind = str(rng.choice(KINDS))
    scene: Description = {"type": "scene", "integrator": _integrator()}
    scene |= BUILDERS[kind](rng, textures)
    scene |= _lights(rng, is_outdoors=kind in ("open", "close"))
    for number in range(int(rng.integers(4, 12)) if kind != "close" else 2):
        scene[f"object{number}"] = _object(rng, textures, kind)
    return scene | {"sensor": _camera(rng, kind, side_px)}


def _integrator() -> Description:
    return {
        "type": "aov", "aovs": "distance:depth", "image": {"type": "path", "max_depth": 5},
    }  # fmt: skip


def _interior(rng: np.random.Generator, textures: list[np.ndarray]) -> Description:
    """A closed box, seen from within."""
    half = rng.uniform(2.0, 4.0, 3) * (1.0, 0.4, 1.0)
    faces = {
        "floor": ((0, 0, 0), (-90, 0)), "ceiling": ((0, 2 * half[1], 0), (90, 0)),
        "back": ((0, half[1], -half[2]), (0, 0)), "front": ((0, half[1], half[2]), (0, 180)),
        "left": ((-half[0], half[1], 0), (0, 90)), "right": ((half[0], half[1], 0), (0, -90)),
    }  # fmt: skip
    return {
        name: _rectangle(place, turn, 4.5, _material(rng, textures))
        for name, (place, turn) in faces.items()
    }


def _table(rng: np.random.Generator, textures: list[np.ndarray]) -> Description:
    """A plane that fills the view, without a horizon, and a wall far behind it."""
    wall = _rectangle((0, 3, -rng.uniform(4, 9)), (0, 0), 14.0, _material(rng, textures))
    return {"floor": _rectangle((0, 0, 0), (-90, 0), 12.0, _material(rng, textures)), "wall": wall}


def _open(rng: np.random.Generator, textures: list[np.ndarray]) -> Description:
    return {"floor": _rectangle((0, 0, 0), (-90, 0), 400.0, _material(rng, textures, repeat=90))}


def _wall(rng: np.random.Generator, textures: list[np.ndarray]) -> Description:
    """A wall at an angle fills the view: the image row says nothing."""
    turn = (0.0, float(rng.uniform(-50, 50)))
    return {"wall": _rectangle((0, 1, -2.5), turn, 15.0, _material(rng, textures))}


def _close(rng: np.random.Generator, textures: list[np.ndarray]) -> Description:
    """Large things in front of a far wall, as in a portrait."""
    wall = _rectangle((0, 1, -rng.uniform(3, 12)), (0, 0), 30.0, _material(rng, textures))
    big = _object(rng, textures, "close")
    return {"wall": wall, "big": big | {"to_world": _placed((0, 0.6, -0.5), 0.7, rng)}}


BUILDERS: dict[str, Callable[[np.random.Generator, list[np.ndarray]], Description]] = {
    "interior": _interior, "table": _table, "open": _open, "wall": _wall, "close": _close,
}  # fmt: skip


def _object(rng: np.random.Generator, textures: list[np.ndarray], kind: str) -> Description:
    size = float(np.exp(rng.uniform(np.log(0.12), np.log(0.7))))
    reach = 6.0 if kind == "open" else 1.9
    place = (rng.uniform(-reach, reach) * 0.7, size, rng.uniform(-reach, 0.9))
    if kind in ("wall", "close"):
        place = (place[0], rng.uniform(-0.2, 2.2), place[2])
    shape = str(rng.choice(SHAPES))
    return {
        "type": shape,
        "to_world": _placed(place, size, rng, is_stretched=shape == "cube"),
        "bsdf": _material(rng, textures, repeat=1, shiny=True),
    }


def _placed(
    place: tuple[float, ...], size: float, rng: np.random.Generator, *, is_stretched: bool = False
) -> Any:
    """Turned at random; only cubes may have sides of different lengths."""
    import mitsuba

    transform = mitsuba.ScalarTransform4f
    axis = rng.normal(size=3)
    stretch = size * np.exp(rng.uniform(-0.5, 0.5, 3) if is_stretched else np.zeros(3))
    turned = transform().rotate((axis / np.linalg.norm(axis)).tolist(), float(rng.uniform(0, 360)))
    moved = transform().translate(list(map(float, place)))
    return moved @ turned @ transform().scale(stretch.tolist())


def _rectangle(
    place: tuple[float, ...], turn_deg: tuple[float, float], half_m: float, bsdf: Description
) -> Description:
    import mitsuba

    transform = mitsuba.ScalarTransform4f
    turned = transform().rotate([0, 1, 0], turn_deg[1]) @ transform().rotate([1, 0, 0], turn_deg[0])
    to_world = transform().translate(list(map(float, place))) @ turned @ transform().scale(half_m)
    return {"type": "rectangle", "to_world": to_world, "bsdf": bsdf}


def _material(
    rng: np.random.Generator, textures: list[np.ndarray], repeat: float = 6, shiny: bool = False
) -> Description:
    if rng.random() < 0.6:
        color = _texture(rng, textures, repeat)
    else:
        color = {"type": "rgb", "value": rng.uniform(0.05, 0.9, 3).tolist()}
    kind = rng.random()
    if shiny and kind < 0.12:
        return {"type": "roughconductor", "alpha": float(rng.uniform(0.1, 0.4))}
    if shiny and kind < 0.4:
        return {"type": "plastic", "diffuse_reflectance": color}
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": color}}


def _texture(rng: np.random.Generator, textures: list[np.ndarray], repeat: float) -> Description:
    import mitsuba

    image = textures[int(rng.integers(len(textures)))]
    scale = mitsuba.ScalarTransform3f().scale([float(repeat * rng.uniform(0.5, 1.5))] * 2)
    return {"type": "bitmap", "bitmap": mitsuba.Bitmap(image.astype(np.float32)), "to_uv": scale,
            "raw": True}  # fmt: skip


def _lights(rng: np.random.Generator, *, is_outdoors: bool) -> Description:
    """A sky of one colour, or a lamp with a little light from everywhere."""
    if is_outdoors:
        color = {"type": "rgb", "value": rng.uniform(0.4, 1.1, 3).tolist()}
        return {"light": {"type": "constant", "radiance": color}}
    fill = {"type": "constant", "radiance": _gray(rng.uniform(0.1, 0.4))}
    return {"lamp": _lamp(rng), "fill": fill}


def _lamp(rng: np.random.Generator) -> Description:
    place = (rng.uniform(-1.5, 1.5), rng.uniform(2.2, 3.0), rng.uniform(-1.0, 1.5))
    emitter = {"type": "area", "radiance": _gray(rng.uniform(15, 40))}
    import mitsuba

    to_world = mitsuba.ScalarTransform4f().translate(list(place)).scale(0.3)
    return {"type": "sphere", "to_world": to_world, "emitter": emitter}


def _gray(value: float) -> Description:
    return {"type": "rgb", "value": [float(value)] * 3}


def _camera(rng: np.random.Generator, kind: str, side_px: int) -> Description:
    import mitsuba

    far = {"interior": 1.9, "table": 2.6, "open": 6.0, "wall": 2.8, "close": 3.2}[kind]
    pitch = np.radians(rng.uniform(-5, 60) if kind != "open" else rng.uniform(2, 25))
    turn = np.radians(rng.uniform(-35, 35))
    target = np.array([0, 0.6 if kind != "wall" else 1.0, -0.6])
    away = far * np.array(
        [np.sin(turn) * np.cos(pitch), max(np.sin(pitch), 0.02), np.cos(turn) * np.cos(pitch)]
    )
    roll = np.radians(rng.uniform(-15, 15))
    to_world = mitsuba.ScalarTransform4f().look_at(
        origin=(target + away).tolist(), target=target.tolist(),
        up=[float(np.sin(roll)), float(np.cos(roll)), 0.0],
    )  # fmt: skip
    film = {"type": "hdrfilm", "width": side_px, "height": side_px, "rfilter": {"type": "box"}}
    return {
        "type": "perspective", "fov": float(rng.uniform(32, 75)), "to_world": to_world,
        "film": film, "sampler": {"type": "independent", "sample_count": 48},
    }  # fmt: skip
