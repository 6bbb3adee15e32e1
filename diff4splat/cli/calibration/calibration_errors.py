"""Errors of settings on the inputs of a calibration: frames against those of the reference."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.limits import baking, exporting, generation, rendering
from diff4splat.cli.limits.measured import frame_error
from diff4splat.io.scene_files.motion_tensors import pack_motion
from diff4splat.outputs.budgets.table import SettingRow, SettingValues

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.scene.scene import Scene

CAMERA, FRAMES, SEED = "arc:0.1", 3, 0
Advance = Callable[[], None]


def generation_settings() -> list[SettingValues]:
    """Every setting of ``generate`` that a limit may choose.

    Smaller images lose more by their size than by any number of steps.
    """
    steps_at = {1.0: (7, 5, 3, 1), 0.75: (3,), 0.5: (3,)}
    return [
        {"side_share": share, "color_matching_steps": steps, "infill": infill}
        for share, choices in steps_at.items()
        for infill, steps in product(("subpixel", "none"), choices)
    ]


def generation_rows(photos: Sequence[Path], advance: Advance) -> tuple[SettingRow, ...]:
    """Largest share of the photograph's detail that each setting loses."""
    settings = generation_settings()
    errors = [_photo_errors(photo, settings, advance) for photo in photos]
    return _worst(settings, errors)


def render_rows(scenes: Sequence["Scene"], advance: Advance) -> tuple[SettingRow, ...]:
    """Largest error of each setting of ``render``."""
    settings = [
        {"side_share": share, "alpha_cutoff": cutoff}
        for share, cutoff in product(rendering.SIDE_SHARES, rendering.CUTOFFS)
    ]
    errors = []
    for scene in scenes:
        errors.append([render_error(scene, values) for values in settings])
        advance()
    return _worst(settings, errors)


def bake_rows(scenes: Sequence["Scene"], advance: Advance) -> tuple[SettingRow, ...]:
    """Largest error of each tolerance in pixels, for each kind of motion."""
    rows: list[SettingRow] = []
    kinds = [pack_motion(scene.motion).settings["kind"] for scene in scenes]
    for kind in dict.fromkeys(kinds):
        settings = [{"motion": kind, "tolerance_px": px} for px in baking.TOLERANCES_PX]
        errors = []
        for scene in (one for one, own in zip(scenes, kinds, strict=True) if own == kind):
            errors.append([bake_error(scene, values["tolerance_px"]) for values in settings])
            advance()
        rows += _worst(settings, errors)
    return tuple(rows)


def bake_error(scene: "Scene", tolerance_px: float) -> float:
    """Of frames from key frames within a tolerance."""
    from diff4splat.cli.scenes.bake import unique_views
    from diff4splat.scene.motion.bake import bake_within

    views = unique_views(scene.path.cameras)
    motion, _ = bake_within(scene.gaussians, scene.motion, views, tolerance_px)
    return baking.frames_error(scene, replace(scene, motion=motion))


def html_rows(scenes: Sequence["Scene"], advance: Advance) -> tuple[SettingRow, ...]:
    """Largest error of what a page leaves out."""
    settings = [
        {"min_opacity": opacity, "degree": degree}
        for opacity, degree in product(exporting.MIN_OPACITIES, exporting.DEGREES)
    ]
    errors = []
    for scene in scenes:
        errors.append(
            [baking.frames_error(scene, exporting.reduced(scene, values)) for values in settings]
        )
        advance()
    return _worst(settings, errors)


def generated_frames(
    photo: Path,
    values: SettingValues,
    model: str = "small",
    side_px: int = 256,
    camera: str = CAMERA,
) -> list["Tensor"]:
    """Frames of a generation with a setting, at its own size."""
    from diff4splat.generation.inputs.image_size import find_image_size
    from diff4splat.generation.inputs.input_cameras import path_frame
    from diff4splat.generation.inputs.input_image import load_image
    from diff4splat.generation.pipeline import Diff4SplatPipeline
    from diff4splat.generation.settings import GenerationSettings
    from diff4splat.paths.build import build_path
    from diff4splat.paths.settings import PathSettings
    from diff4splat.render.api import render_video

    side_px, multiple_px = find_image_size(model, round(side_px * values["side_share"]))
    image = load_image(photo, side_px, multiple_px=multiple_px, convert=True)
    path = build_path(camera, path_frame(image.camera), PathSettings(frames=FRAMES, fps=24.0))
    settings = GenerationSettings(
        color_matching_steps=values["color_matching_steps"],
        subpixel_infill=values.get("infill") != "none",
    )
    pipeline = Diff4SplatPipeline.from_pretrained(model)
    scene = pipeline(image, path, seed=SEED, settings=settings)
    return [frame.rgb for frame in render_video(scene, scene.path)]


def _photo_errors(photo: Path, settings: Sequence[SettingValues], advance: Advance) -> list[float]:
    from diff4splat.generation.inputs.image_detail import image_detail

    reference = {"side_share": 1.0, "color_matching_steps": generation.REFERENCE_STEPS}
    exact = generated_frames(photo, reference)
    detail = image_detail(exact[0].clamp(0, 1))
    errors = []
    for values in settings:
        frames = generated_frames(photo, values)
        errors.append(mean_error(frames, exact) / detail)
        advance()
    return errors


def render_error(scene: "Scene", values: SettingValues) -> float:
    """Of three frames of the scene's path at a setting of ``render``."""
    from diff4splat.render.api import DEFAULTS, render

    settings = replace(DEFAULTS, alpha_cutoff=values["alpha_cutoff"])
    exact_settings = replace(DEFAULTS, alpha_cutoff=min(rendering.CUTOFFS))
    path = scene.path
    smaller = rendering.at_share(path, values["side_share"])
    indices = sorted({len(path) // 4, len(path) // 2, 3 * len(path) // 4})
    frames, exact = [], []
    for k in indices:
        time_s = float(path.times_s[k])
        frames.append(render(scene, smaller.cameras[k], time_s, settings=settings).rgb)
        exact.append(render(scene, path.cameras[k], time_s, settings=exact_settings).rgb)
    return mean_error(frames, exact)


def mean_error(frames: Sequence["Tensor"], exact: Sequence["Tensor"]) -> float:
    """Mean square difference over all frames."""
    pairs = list(zip(frames, exact, strict=True))
    return sum(frame_error(frame, one) for frame, one in pairs) / len(pairs)


def _worst(
    settings: Sequence[SettingValues], errors: Iterable[Sequence[float]]
) -> tuple[SettingRow, ...]:
    """The largest error over the inputs."""
    largest = [max(column) for column in zip(*errors, strict=True)]
    return tuple(
        SettingRow(values=values, error=error)
        for values, error in zip(settings, largest, strict=True)
    )
