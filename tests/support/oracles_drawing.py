"""Small worlds, and what is seen in them by brute force: rays against all triangles in float64."""

import math

import numpy as np
import torch

from diff4splat.data.clip import ClipMetadata
from diff4splat.data_prep.synthetic.world import Light, Mesh, Sky, Texture, World, WorldObject
from diff4splat.geometry.camera import Camera


def texture(family: str = "noise", scale: float = 2.0, **changes) -> Texture:
    return Texture(
        **{
            "family": family,
            "colors": np.array([[0.55, 0.42, 0.3], [0.3, 0.2, 0.13], [0.7, 0.66, 0.6]]),
            "scale": scale,
            "seed": 7,
            **changes,
        }
    )


def light(toward=(0.45, -0.8, -0.4), softness: float = 0.03) -> Light:
    direction = np.array(toward, float)
    return Light(
        color=np.array([2.6, 2.35, 2.0]),
        toward=direction / np.sqrt((direction**2).sum()),
        sky=np.array([0.45, 0.6, 0.85]),
        ground=np.array([0.25, 0.2, 0.16]),
        softness=softness,
    )


def sky(clouds: float = 0.4, haze: float = 0.005) -> Sky:
    return Sky(
        zenith=np.array([0.25, 0.5, 1.1]),
        horizon=np.array([0.9, 1.0, 1.15]),
        clouds=clouds,
        haze_per_m=haze,
        seed=3,
    )


def mesh(vertices, triangles, uv=None, smooth: bool = False) -> Mesh:
    rest = np.ascontiguousarray(vertices, np.float64).reshape(-1, 3)
    return Mesh(
        triangles=np.ascontiguousarray(triangles, np.int32).reshape(-1, 3),
        rest=rest,
        uv=rest[:, [0, 2]].copy() if uv is None else np.ascontiguousarray(uv, np.float64),
        smooth=smooth,
    )


def thing(instance: int, shape: Mesh, look: Texture | None = None, positions=None) -> WorldObject:
    return WorldObject(
        instance=instance,
        mesh=shape,
        texture=look or texture(),
        positions=shape.rest[None] if positions is None else np.ascontiguousarray(positions),
    )


def ground(half_m: float = 12.0, cells: int = 4) -> Mesh:
    steps = np.linspace(-half_m, half_m, cells + 1)
    x, z = np.meshgrid(steps, steps + 4.0)
    vertices = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], -1)
    return mesh(vertices, _quads(cells, cells))


def _quads(rows: int, columns: int) -> np.ndarray:
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    a = (i * (columns + 1) + j).ravel()
    b, c, d = a + 1, a + columns + 1, a + columns + 2
    return np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)])


def sphere(center, radius: float, rows: int = 24) -> Mesh:
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, 2 * rows + 1), indexing="ij")
    polar, turn = v * math.pi, u * 2 * math.pi
    vertices = np.stack(
        [np.sin(polar) * np.cos(turn), -np.cos(polar), np.sin(polar) * np.sin(turn)], -1
    )
    uv = np.stack([u * 2 * math.pi * radius, v * math.pi * radius], -1)
    return mesh(
        vertices.reshape(-1, 3) * radius + np.asarray(center),
        _quads(rows, 2 * rows),
        uv.reshape(-1, 2),
        smooth=True,
    )


def box(center, half) -> Mesh:
    vertices, triangles, uv = [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            start = len(vertices)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3] = side, a, b
                vertices.append(corner * half + np.asarray(center))
                uv.append((a * half[(axis + 1) % 3], b * half[(axis + 2) % 3]))
            triangles += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return mesh(vertices, triangles, uv)


def torus(center, radius: float, thickness: float, rows: int = 40) -> Mesh:
    u, v = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, rows // 2 + 1), indexing="ij")
    around, turn = u * 2 * math.pi, v * 2 * math.pi
    wide = radius + thickness * np.cos(turn)
    vertices = np.stack(
        [wide * np.cos(around), thickness * np.sin(turn), wide * np.sin(around)], -1
    )
    uv = np.stack([u * 2 * math.pi * radius, v * 2 * math.pi * thickness], -1)
    return mesh(
        vertices.reshape(-1, 3) + np.asarray(center),
        _quads(rows, rows // 2),
        uv.reshape(-1, 2),
        smooth=True,
    )


def cameras(frames: int, size_px=(24, 32), start=(0.0, -1.6, -4.0), side: float = 0.6) -> Camera:
    """A camera that slides to the right and looks a little down at the origin."""
    poses = torch.eye(4, dtype=torch.float64).repeat(frames, 1, 1)
    for frame in range(frames):
        share = frame / max(frames - 1, 1)
        here = np.array(start) + np.array([side * share, 0.0, 0.0])
        forward = np.array([0.0, -0.5, 0.0]) - here
        forward /= np.sqrt((forward**2).sum())
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.sqrt((right**2).sum())
        poses[frame, :3, :3] = torch.from_numpy(
            np.stack([right, np.cross(forward, right), forward], -1)
        )
        poses[frame, :3, 3] = torch.from_numpy(here)
    return Camera(
        focal_px=torch.full((frames, 2), 1.1 * size_px[1], dtype=torch.float64),
        center_px=torch.tensor([size_px[1] / 2, size_px[0] / 2], dtype=torch.float64).repeat(
            frames, 1
        ),
        world_from_camera=poses,
        size_px=size_px,
    )


def world(objects, views, frames: int = 3, **changes) -> World:
    return World(
        **{
            "note": ClipMetadata(
                identifier="test", source="test", license="CC0-1.0", metric="exact"
            ),
            "times_s": np.arange(frames) / 8.0,
            "objects": tuple(objects),
            "light": light(),
            "sky": sky(),
            "views": tuple(views),
            **changes,
        }
    )


def still_life(frames: int = 3, size_px=(24, 32), views: int = 2) -> World:
    """A ball that rolls past a box and a ring that stand on the ground."""
    ball = sphere((0.0, -0.5, 0.0), 0.5, rows=12)
    shift = np.linspace(-0.8, 0.8, frames)[:, None, None] * np.array([1.0, 0.0, 0.2])
    parts = [
        thing(1, ground(), texture("planks", 2.0, relief=0.004)),
        thing(2, box((-0.9, -0.4, 1.2), (0.4, 0.4, 0.4)), texture("brick", 8.0, relief=0.01)),
        thing(3, torus((0.9, -0.16, 0.6), 0.45, 0.16, 20), texture("marble", 3.0, gloss=0.6)),
        thing(9, ball, texture("stripes", 4.0, gloss=0.4), ball.rest[None] + shift),
    ]
    paths = [
        cameras(frames, size_px),
        cameras(frames, size_px, (1.5, -1.2, -3.5), -0.5),
        cameras(frames, size_px, (-2.0, -2.2, -3.0), 0.2),
    ]
    return world(parts, paths[:views], frames)


def soup(count: int, seed: int = 0, far_m: float = 6.0, size_m: float = 1.5) -> Mesh:
    """Triangles anywhere in front of, around and behind the origin."""
    draw = np.random.default_rng(seed)
    middle = draw.uniform([-3, -3, -1], [3, 3, far_m], (count, 1, 3))
    corners = middle + draw.normal(size=(count, 3, 3)) * size_m
    return mesh(corners, np.arange(3 * count).reshape(-1, 3))


def straight(frames: int, size_px=(24, 32), step=(0.05, 0.02, 0.1)) -> Camera:
    """A camera that starts at the origin with no rotation and moves steadily."""
    poses = torch.eye(4, dtype=torch.float64).repeat(frames, 1, 1)
    poses[:, :3, 3] = torch.arange(frames, dtype=torch.float64)[:, None] * torch.tensor(step)
    return Camera(
        focal_px=torch.full((frames, 2), 0.9 * size_px[1], dtype=torch.float64),
        center_px=torch.tensor([size_px[1] / 2, size_px[0] / 2], dtype=torch.float64).repeat(
            frames, 1
        ),
        world_from_camera=poses,
        size_px=size_px,
    )


def cast(corners: np.ndarray, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Ray parameter (n f) at which origin + s · ray meets each triangle; infinite where it misses.

    Moeller and Trumbore 1997: s, u, v from three triple products.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    first, second = b - a, c - a
    across = np.cross(rays[:, None], second[None])
    volume = (across * first[None]).sum(-1)
    away = origin - a
    with np.errstate(divide="ignore", invalid="ignore"):
        u = (across * away[None]).sum(-1) / volume
        turned = np.cross(away, first)
        v = (rays[:, None] * turned[None]).sum(-1) / volume
        s = (second * turned).sum(-1)[None] / volume
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (s > 0)
    return np.where(hit, s, np.inf)


def pixel_rays(camera: Camera, frame: int, per_side: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Origin, and world directions whose parameter is z, at the middles of a grid of samples."""
    height, width = camera.size_px
    v, u = np.meshgrid(
        (np.arange(height * per_side) + 0.5) / per_side,
        (np.arange(width * per_side) + 0.5) / per_side,
        indexing="ij",
    )
    return camera.world_from_camera[frame, :3, 3].numpy(), rays_through(
        camera, frame, np.stack([u.ravel(), v.ravel()], -1)
    )


def rays_through(camera: Camera, frame: int, pixels: np.ndarray) -> np.ndarray:
    """World directions of pixel coordinates (n 2), with z = 1 in camera axes."""
    local = (pixels - camera.center_px[frame].numpy()) / camera.focal_px[frame].numpy()
    local = np.concatenate([local, np.ones((len(local), 1))], -1)
    return local @ camera.world_from_camera[frame, :3, :3].numpy().T


def project(camera: Camera, frame: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixel coordinates and depth of world points."""
    pose = camera.world_from_camera[frame].numpy()
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    pixels = local[:, :2] / local[:, 2:] * camera.focal_px[frame].numpy()
    return pixels + camera.center_px[frame].numpy(), local[:, 2]


def looking_down() -> torch.Tensor:
    """The rotation of a camera that looks straight down; the image's top is world +z."""
    return torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]], dtype=torch.float64)
