"""Fields of view of 1 to 170 degrees, and cameras where no photographer stands."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import torch

from diff4splat.generation.inputs.input_cameras import to_camera_path
from diff4splat.generation.inputs.input_image import choose_focal
from diff4splat.geometry import rigid
from diff4splat.geometry.camera import Camera, pinhole, stack_cameras
from diff4splat.scene.gaussians import Gaussians
from diff4splat.stability.check import Check, Outcome
from diff4splat.stability.compare import psnr_db
from diff4splat.stability.plots import Thumbnail
from diff4splat.stability.subjects.cloud import DISTANCE, SIZE_PX, camera, cloud
from diff4splat.stability.subjects.rendered import RENDER_LIMIT, measure_render

GROUP = "cameras"
FIELDS_OF_VIEW_DEG = (0.5, 1.0, 10.0, 60.0, 120.0, 150.0, 170.0, 175.0)
PATHS = (
    "orbit:1",
    "orbit:100",
    "roll:1",
    "spiral:2",
    "forward:0.99",
    "forward:1",
    "dolly-zoom:0.9",
)
QUICK = ("field of view 170°", "field of view 175°", "inside the scene")
FRAMES = 8
Place = tuple[float | int, ...]
"""x, y, z in scene units."""
OFFSETS = (1e3, 1e6)
"""A float32 at 1e6 has steps of 1/16; what is compared is the image of the rounded scene."""


def camera_checks() -> Iterator[Check]:
    """Rasterised images of one cloud of Gaussians."""
    views: dict[str, Callable[[], Camera]] = {
        f"field of view {fov:g}°": partial(_field_of_view, fov) for fov in FIELDS_OF_VIEW_DEG
    }
    views |= {
        "behind the scene": lambda: _at((0, 0, 2 * DISTANCE), (0, 0, DISTANCE)),
        "behind the scene, turned away": lambda: _at((0, 0, 2 * DISTANCE), (0, 0, 3 * DISTANCE)),
        "inside the scene": lambda: _at((0.1, 0, DISTANCE), (0, 0, 2 * DISTANCE)),
        "in the middle of a Gaussian": _in_a_gaussian,
        "through the scene": _through,
        "360° around the scene": partial(_around, DISTANCE),
        "360° around inside the scene": partial(_around, 0.3),
        "at a distance of 1e6": lambda: _at((0, 0, -1e6), (0, 0, DISTANCE)),
    }
    views |= {f"camera path {text}": partial(_path, text) for text in PATHS}
    for offset in OFFSETS:
        yield Check(
            group=GROUP,
            name=f"scene and camera at an offset of {offset:g}",
            run=partial(_offset, offset),
            limit=RENDER_LIMIT,
            error_unit="RMS of RGB",
        )
    for name, view in views.items():
        yield Check(
            group=GROUP,
            name=name,
            run=partial(measure_views, view),
            limit=RENDER_LIMIT,
            error_unit="RMS of RGB",
            quick=name in QUICK,
        )


def measure_views(view: Callable[[], Camera], gaussians: Gaussians | None = None) -> Outcome:
    """One camera, or the worst of several."""
    cameras, scene = view(), cloud() if gaussians is None else gaussians
    single = cameras.batch_shape == ()
    every = [cameras] if single else [cameras[index] for index in range(len(cameras))]
    results = [measure_render(scene, one) for one in every]
    worst = max(results, key=lambda result: _rank(result.error))
    gradients = {result.gradient_finite for result in results} - {None}
    middle: Thumbnail = results[len(results) // 2].plots[0]
    return Outcome(
        error=worst.error,
        value_finite=all(result.value_finite for result in results),
        gradient_finite=all(gradients) if gradients else None,
        note=worst.note if single else f"worst of {len(every)} frames: {psnr_db(worst.error)}",
        plots=(middle,),
    )


def _offset(offset: float) -> Outcome:
    """The same view of the same scene, elsewhere in the world."""
    gaussians, pose = cloud(), torch.eye(4)
    pose[:3, 3] = offset
    moved = replace(gaussians, means=gaussians.means + offset)
    return measure_views(lambda: camera().with_pose(pose), moved)


def _rank(error: float) -> float:
    return math.inf if math.isnan(error) else error


def _field_of_view(fov_deg: float) -> Camera:
    """As `generate --fov` makes it."""
    return pinhole(choose_focal(SIZE_PX, fov_deg, None).focal_px, SIZE_PX)


def _path(text: str) -> Camera:
    """Some cameras of a path, as `generate --camera` makes it."""
    cameras = to_camera_path(text, camera()).cameras
    return cameras[torch.linspace(0, len(cameras) - 1, FRAMES).long()]


def _at(position: Place, target: Place) -> Camera:
    eye, aim = (torch.tensor(point, dtype=torch.float32) for point in (position, target))
    return camera().with_pose(rigid.look_at(eye, aim, torch.tensor([0.0, 1.0, 0.0])))


def _in_a_gaussian() -> Camera:
    """At the mean of the first one, nearer than any camera draws it."""
    return _at(tuple(cloud().means[0].tolist()), (0, 0, 2 * DISTANCE))


def _through() -> Camera:
    """Straight on, from before the cloud to beyond it."""
    places = torch.linspace(0, 2 * DISTANCE, FRAMES).tolist()
    return stack_cameras([_at((0, 0, z), (0, 0, z + 1)) for z in places])


def _around(radius: float) -> Camera:
    """On a circle around the middle of the cloud, looking at it."""
    angles = [2 * math.pi * index / FRAMES for index in range(FRAMES)]
    places = [(radius * math.sin(a), 0.0, DISTANCE - radius * math.cos(a)) for a in angles]
    return stack_cameras([_at(place, (0, 0, DISTANCE)) for place in places])
