"""The experiments, each against a baseline; every one gives rows of a table.

fisheye   a scene out of fisheye frames; the baseline takes them for a pinhole's
rolling   a moving scene out of rolling-shutter frames; the baseline takes them for snapshots
lens      k_1 off by 0.05
focus     focus distance 1.5 times too large
readout   half of the read-out time
"""

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch

from benchmarks.optics_fitting.captures import seen_db, taken, told
from benchmarks.optics_fitting.worlds import views, world
from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.evaluator import mean_psnr_db
from diff4splat.fitting.fit import fit_scene
from diff4splat.fitting.fit_types import FitRequest, FitResult
from diff4splat.fitting.optics.coefficients import largest_displacement_px
from diff4splat.fitting.settings import (
    CameraSettings,
    DensitySettings,
    FitSettings,
    StaticDetectionSettings,
)
from diff4splat.geometry.camera import Camera, pinhole
from diff4splat.geometry.lenses.build import fisheye_camera
from diff4splat.geometry.lenses.opencv_fisheye import OpenCVFisheye
from diff4splat.geometry.optics import Aperture, Optics, Shutter
from diff4splat.render.physical.view_cone import radians_per_pixel
from diff4splat.scene.scene import Provenance, Scene

Row = dict[str, str | float]
SIDE_PX = 64
TIMES = 6
READOUT_S = 0.16
"""Of 0.2 s from frame to frame."""
LENS = (0.05, -0.01, 0.002, 0.0)
FOV_DEG = {"fisheye": 160.0, "lens": 120.0}
FOCUS_DISTANCE, RADII = 1.3, (0.06, 0.15)
STEPS = {"fisheye": 2000, "rolling": 2000, "lens": 2000, "focus": 600, "readout": 2000}


def fisheye() -> list[Row]:
    """Held out through the fisheye, and through pinholes that nobody took images with."""
    room, (cameras, optics) = world(1, moving=False), _fisheye(FOV_DEG["fisheye"])
    capture = taken(room, views(16, cameras, 1), (0.0,), optics, 8)
    step = radians_per_pixel(cameras, optics)
    new = views(6, _pinhole(), 77, distance=1.2)
    rows = []
    for name, given in (("fisheye", capture), ("taken for a pinhole", _flattened(capture, step))):
        result, seconds = fitted(given, "static", STEPS["fisheye"])
        seen = seen_db(room.scene, _scene(result, capture), new, (0.0,))
        rows.append(_quality("fisheye", name, result, seconds) | {"new views, dB": seen})
    return rows


def rolling() -> list[Row]:
    """Held out as it was taken, and at single instants from where nobody stood."""
    room, cameras, capture = _rolling_capture()
    new = views(4, cameras, 78, distance=1.2)
    rows = []
    for name, given in (("read-out known", capture), ("taken for snapshots", told(capture, None))):
        result, seconds = fitted(given, "spacetime", STEPS["rolling"])
        seen = seen_db(room.scene, _scene(result, capture), new, (0.3, 0.5, 0.7))
        rows.append(_quality("rolling", name, result, seconds) | {"new views, dB": seen})
    return rows


def lens() -> list[Row]:
    """Largest displacement over the image between the lens and the true one."""
    room, (cameras, optics) = world(2, moving=False), _fisheye(FOV_DEG["lens"])
    capture = taken(room, views(16, cameras, 2), (0.0,), optics, 8)
    off = optics.lens.coefficients + torch.tensor([0.05, 0.0, 0.0, 0.0]).double()
    wrong = told(capture, replace(optics, lens=OpenCVFisheye(coefficients=off)))
    rows = []
    for name, learn in (("learned", ("lens",)), ("left wrong", ())):
        result, seconds = fitted(wrong, "static", STEPS["lens"], learn=learn)
        found = result.cameras.optics.lens if result.cameras else wrong.optics.lens
        error = largest_displacement_px(optics.lens, found, cameras)
        before = largest_displacement_px(optics.lens, wrong.optics.lens, cameras)
        rows.append(
            _quality("lens", name, result, seconds)
            | {"before": f"{before:.2f} px", "after": f"{error:.3f} px"}
        )
    return rows


def focus() -> list[Row]:
    """Relative error of the focus distance, through a small and a large aperture."""
    return [row for radius in RADII for row in _focus(radius)]


def _focus(radius: float) -> list[Row]:
    room, cameras = world(3, moving=False), _pinhole()
    aperture = Aperture(radius=radius, focus_distance=FOCUS_DISTANCE)
    capture = taken(room, views(16, cameras, 3), (0.0,), Optics(aperture=aperture), 8)
    guess = replace(aperture, focus_distance=1.5 * FOCUS_DISTANCE)
    rows = []
    for name, learn in (("learned", ("focus",)), ("left wrong", ())):
        result, seconds = fitted(
            told(capture, Optics(aperture=guess)), "static", STEPS["focus"], learn=learn
        )
        found = result.learned["focus"]["recovered"] if learn else guess.focus_distance
        own = f"focus, radius {radius:g}"
        rows.append(_quality(own, name, result, seconds) | _error(found, FOCUS_DISTANCE, 1.5))
    return rows


def readout() -> list[Row]:
    """Relative error of the read-out time."""
    _, _, capture = _rolling_capture()
    guess = Optics(shutter=Shutter(readout_s=0.5 * READOUT_S))
    rows = []
    for name, learn in (("learned", ("readout",)), ("left wrong", ())):
        result, seconds = fitted(told(capture, guess), "spacetime", STEPS["readout"], learn=learn)
        found = result.learned["readout"]["recovered"] if learn else 0.5 * READOUT_S
        rows.append(_quality("readout", name, result, seconds) | _error(found, READOUT_S, 0.5))
    return rows


EXPERIMENTS: dict[str, Callable[[], list[Row]]] = {
    "fisheye": fisheye, "rolling": rolling, "lens": lens, "focus": focus, "readout": readout,
}  # fmt: skip


def fitted(
    capture: Capture, motion: str, steps: int, learn: tuple[str, ...] = ()
) -> tuple[FitResult, float]:
    """A fit of the points of the capture; none are added or taken away."""
    settings = FitSettings(
        motion=motion, harmonics=0, coarse_steps=steps // 3 if motion != "static" else 0,
        fine_steps=steps, time_slices=1, judge_every=100, checkpoint_every=10_000,
        density=DensitySettings(budget=4000, until=0.0),
        stillness=StaticDetectionSettings(min_score=0.02, checks=()),
        camera=CameraSettings(learn=learn, start=100, samples=8, shown_samples=16),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        result = fit_scene(
            FitRequest(capture=capture, settings=settings, folder=Path(folder), note=_say)
        )
        return result, time.perf_counter() - began


def _say(text: str) -> None:
    print(f"    {text}", flush=True)


def _quality(experiment: str, name: str, result: FitResult, seconds: float) -> Row:
    return {
        "experiment": experiment,
        "fit": name,
        "held out, dB": mean_psnr_db(result.held_out),
        "learnt from, dB": mean_psnr_db(result.training),
        "s": seconds,
    }


def _error(found: float, truth: float, factor: float) -> Row:
    return {"before": f"{factor - 1:+.0%}", "after": f"{found / truth - 1:+.2%}"}


def _scene(result: FitResult, capture: Capture) -> Scene:
    return Scene(
        gaussians=result.gaussians, motion=result.motion, path=result.renderer.path,
        provenance=Provenance(generator="benchmark"),
    )  # fmt: skip


def _fisheye(fov_deg: float) -> tuple[Camera, Optics]:
    own = OpenCVFisheye(coefficients=torch.tensor(LENS).double())
    return fisheye_camera(fov_deg, (SIDE_PX, SIDE_PX), own, torch.float64), Optics(lens=own)


def _pinhole() -> Camera:
    return pinhole(SIDE_PX / (2 * math.tan(math.radians(35))), (SIDE_PX, SIDE_PX), torch.float64)


def _flattened(capture: Capture, step: float) -> Capture:
    """As if the lens were a pinhole as fine in the middle of the image."""
    focal_px = torch.full_like(capture.cameras.focal_px, 1 / step)
    return replace(capture, optics=None, cameras=replace(capture.cameras, focal_px=focal_px))


def _rolling_capture():
    room, cameras = world(4, moving=True), _pinhole()
    times_s = [0.1 + 0.8 * number / (TIMES - 1) for number in range(TIMES)]
    optics = Optics(shutter=Shutter(readout_s=READOUT_S))
    return room, cameras, taken(room, views(12, cameras, 4, wander=1.0), times_s, optics, 6)
