"""Output files of a fit: scene, video, comparison with held-out frames, and metadata.

Axes: ``t`` frames, ``h w`` pixels.
"""

import json
import math
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat import __version__
from diff4splat.data.capture.capture import Capture
from diff4splat.fitting.comparison import comparison_sheet
from diff4splat.fitting.evaluator import Evaluator, FrameQuality, mean_psnr_db
from diff4splat.fitting.fit_types import FitResult
from diff4splat.fitting.frames.frame_store import FrameStore
from diff4splat.fitting.settings import FitSettings
from diff4splat.io.atomic import atomic_folder, write_text
from diff4splat.io.cameras.optics_json import optics_json
from diff4splat.io.photos.images import write_png
from diff4splat.io.scene_files.compression import Compression
from diff4splat.outputs.card import LIBRARIES, scene_facts
from diff4splat.outputs.compressed_scene import SceneFileFacts, write_scene
from diff4splat.outputs.scene_folder import write_view
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.phases import peak_memory_bytes
from diff4splat.progress.run_log import RunLog
from diff4splat.render.physical.view_cone import radians_per_pixel
from diff4splat.scene.scene import Provenance, Scene
from diff4splat.viewer.page import write_page_or_reason

RESULT_FILES = ("scene.safetensors", "scene.html", "video.mp4", "comparison.png", "card.json")
COMPARISON_FRAMES = 4
"""Held-out frames on the comparison sheet."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitReport:
    """A fit and its inputs."""

    result: FitResult
    capture: Capture
    settings: FitSettings
    inputs: dict[str, object]
    """Command line options, for ``card.json``."""
    forecast: Callable[[], Mapping[str, object]] | None = None
    """What the fit was expected to need against what it took, asked when all else is written."""


def fitted_scene(report: FitReport) -> Scene:
    """The scene, with the path of the first training camera."""
    result, capture = report.result, report.capture
    return Scene(
        gaussians=result.gaussians,
        motion=result.motion,
        path=preview_path(capture),
        provenance=Provenance(
            generator=f"diff4splat {__version__} fit --motion {report.settings.motion}",
            model=f"{capture.source}: {capture.name}",
            seed=report.settings.seed,
            license=capture.license,
        ),
    )


def preview_path(capture: Capture) -> CameraPath:
    """Frames of the first training camera in order of time; of all cameras if it has only one."""
    training = ~capture.held_out
    first = capture.camera_index[training][0]
    frames = (training & (capture.camera_index == first)).nonzero().flatten()
    if len(frames) < 2:
        frames = training.nonzero().flatten()
    frames = frames[capture.times_s[frames].argsort(stable=True)]
    kept, last = [], -math.inf
    for index in frames.tolist():
        time_s = float(capture.times_s[index])
        if time_s > last:
            kept.append(index)
            last = time_s
    index = torch.tensor(kept)
    cameras = capture.cameras[index]
    if capture.optics is not None:
        # A path has pinhole cameras; keep the resolution of the lens at the image centre.
        step = radians_per_pixel(cameras[0], capture.optics)
        cameras = replace(cameras, focal_px=torch.full_like(cameras.focal_px, 1 / step))
    return CameraPath(cameras=cameras, times_s=capture.times_s[index])


def write_results(
    report: FitReport, folder: Path, log: RunLog, compression: Compression = "standard"
) -> tuple[Scene, SceneFileFacts]:
    """Write all files atomically; they replace those of an earlier call.

    Raises:
        OutputError: the folder cannot be written.
    """
    scene = fitted_scene(report)
    with atomic_folder(folder, RESULT_FILES) as staging:
        scene_file = write_scene(scene, staging / "scene.safetensors", compression)
        write_page_or_reason(scene, staging / "scene.html")
        write_view(scene, scene.path, staging / "video.mp4", None, log)
        write_png(_comparison(report, scene), staging / "comparison.png")
        write_text(staging / "card.json", _card(report, scene, log, scene_file))
    return scene, scene_file


def _comparison(report: FitReport, scene: Scene) -> Float[Tensor, "h w 3"]:
    qualities = report.result.held_out or report.result.training
    at = (
        torch.linspace(0, len(qualities) - 1, min(COMPARISON_FRAMES, len(qualities))).round().long()
    )
    selected = [qualities[i] for i in at.tolist()]
    evaluator = Evaluator(
        renderer=report.result.renderer,
        store=FrameStore(report.capture, dtype=report.settings.torch_dtype),
    )
    truths = [evaluator.store.read(quality.frame).rgb for quality in selected]
    renderings = [evaluator.image(scene, report.result.cameras, q.frame)[0] for q in selected]
    labels = [f"camera {q.camera}, {q.time_s:.2f} s: {q.psnr_db:.1f} dB" for q in selected]
    return comparison_sheet(truths, renderings, labels)


def _card(report: FitReport, scene: Scene, log: RunLog, scene_file: SceneFileFacts) -> str:
    result, capture = report.result, report.capture
    card = {
        "diff4splat": __version__,
        "inputs": report.inputs,
        "capture": {
            "name": capture.name,
            "format": capture.source,
            "split": str(result.split),
            "split_reason": capture.split_reason,
            "notes": list(capture.notes),
            "license": capture.license,
        },
        "held_out": quality_summary(result.held_out),
        "training": quality_summary(result.training),
        "cameras_learned": result.learned,
        "optics": None if result.cameras is None else optics_json(result.cameras.optics),
        "finished": result.finished,
        "settings": asdict(report.settings),
        "provenance": asdict(scene.provenance),
        "scene": scene_facts(scene),
        "scene_file": asdict(scene_file),
        "seconds": {name: round(value, 3) for name, value in log.phases.seconds.items()},
        "seconds_fitting": round(result.seconds, 3),
        "peak_memory_bytes": peak_memory_bytes(),
        "forecast": None if report.forecast is None else report.forecast(),
        "left_out": [*result.skipped_work.to_json(), *log.skipped.to_json()],
        "versions": {name: version(name) for name in LIBRARIES},
        "machine": {
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
            "threads": torch.get_num_threads(),
        },
    }
    return json.dumps(card, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def quality_summary(qualities: Sequence[FrameQuality]) -> dict[str, object] | None:
    """Means over frames, and per camera; None without frames."""
    if not qualities:
        return None
    cameras = sorted({quality.camera for quality in qualities})
    similarities = [quality.ssim for quality in qualities if quality.ssim is not None]
    return {
        "frames": len(qualities),
        "psnr_db": round(mean_psnr_db(qualities), 3),
        "worst_psnr_db": round(min(quality.psnr_db for quality in qualities), 3),
        "ssim": round(sum(similarities) / len(similarities), 4) if similarities else None,
        "psnr_db_per_camera": {
            str(camera): round(mean_psnr_db([q for q in qualities if q.camera == camera]), 3)
            for camera in cameras
        },
    }
