"""Errors of settings on the inputs of a calibration: frames against those of the reference."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import chain, product
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.calibration.scene_errors import (
    bake_settings,
    html_settings,
    mean_error,
    render_settings,
)
from diff4splat.cli.limits import generation
from diff4splat.outputs.budgets.spread import upper_bound
from diff4splat.outputs.budgets.table import SettingRow, SettingValues

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.generation.pipeline import Diff4SplatPipeline
    from diff4splat.scene.scene import Scene

CAMERAS = ("arc:0.1", "left:0.15", "spiral")
"""Three frames of an arc are nearly the photograph's own view; the others show it from the side."""
FRAMES, SEED, SIDE_PX = 3, 0, 192

Paths = Sequence[Sequence["Tensor"]]
"""Frames ``h w 3`` of every camera path."""


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


def photo_errors(photo: Path) -> list[float | None]:
    """What each setting of ``generate`` loses, in units of ``photo_units``.

    None where whole tokens crop the smaller image to another shape.
    """
    reference = {"side_share": 1.0, "color_matching_steps": generation.REFERENCE_STEPS}
    exact = generated_frames(photo, reference)
    return [worst_error(generated_frames(photo, values), exact) for values in generation_settings()]


def worst_error(paths: Paths, exact: Paths) -> float | None:
    """The largest over camera paths of the error, over what the photograph's view loses.

    None where the frames have another shape.
    """
    first = exact[0][0]
    (height, width), full = paths[0][0].shape[:2], first.shape[:2]
    if height * full[1] != width * full[0]:
        return None
    errors = [mean_error(*pair) for pair in zip(paths, exact, strict=True)]
    return max(errors) / generation.error_unit(first.clamp(0, 1), (height, width))


def generated_frames(
    photo: Path,
    values: SettingValues,
    model: str = "small",
    side_px: int = SIDE_PX,
    cameras: Sequence[str] = CAMERAS,
) -> Paths:
    """Frames of a generation with a setting, at its own size, along each camera path."""
    from diff4splat.generation.inputs.image_size import find_image_size
    from diff4splat.generation.inputs.input_cameras import path_frame
    from diff4splat.generation.inputs.input_image import load_image
    from diff4splat.generation.settings import GenerationSettings
    from diff4splat.paths.build import build_path
    from diff4splat.paths.settings import PathSettings
    from diff4splat.render.api import render_video

    side_px, multiple_px = find_image_size(model, round(side_px * values["side_share"]))
    image = load_image(photo, side_px, multiple_px=multiple_px, convert=True)
    frame, length = path_frame(image.camera), PathSettings(frames=FRAMES, fps=24.0)
    paths = [build_path(camera, frame, length) for camera in cameras]
    settings = GenerationSettings(
        color_matching_steps=values["color_matching_steps"],
        subpixel_infill=values.get("infill") != "none",
    )
    # Without a video fill the Gaussians are the same for every path.
    scene = _pipeline(model)(image, paths[0], seed=SEED, settings=settings)
    return [[frame.rgb for frame in render_video(scene, path)] for path in paths]


def all_rows(
    photos: Sequence[Sequence[float | None]],
    scenes: Sequence["Scene"],
    measured: Sequence[Mapping[str, Sequence[float]]],
) -> dict[str, tuple[SettingRow, ...]]:
    """Rows of every command, from ``photo_errors`` and ``scene_errors`` of the inputs."""
    moving = [len(scene.motion.moving_index) > 0 for scene in scenes]
    settings = [
        bake_settings(scene) if moves else [] for scene, moves in zip(scenes, moving, strict=True)
    ]
    return {
        "generate": bounded_rows(generation_settings(), photos),
        "render": worst_rows(render_settings(), [one["render"] for one in measured]),
        "export html": worst_rows(html_settings(), [one["export html"] for one in measured]),
        "bake": rows_of_kinds(settings, [one["bake"] for one in measured]),
    }


@cache
def _pipeline(model: str) -> "Diff4SplatPipeline":
    """Weights are read once for all settings."""
    from diff4splat.generation.pipeline import Diff4SplatPipeline

    return Diff4SplatPipeline.from_pretrained(model)


def bounded_rows(
    settings: Sequence[SettingValues], errors: Iterable[Sequence[float | None]]
) -> tuple[SettingRow, ...]:
    """The error that 19 of 20 new inputs stay below; settings that no input has are left out."""
    columns = [[one for one in column if one is not None] for column in zip(*errors, strict=True)]
    return tuple(
        SettingRow(values=values, error=upper_bound(known))
        for values, known in zip(settings, columns, strict=True)
        if known
    )


def worst_rows(
    settings: Sequence[SettingValues], errors: Iterable[Sequence[float]]
) -> tuple[SettingRow, ...]:
    """The largest error over the inputs."""
    largest = [max(column) for column in zip(*errors, strict=True)]
    return tuple(
        SettingRow(values=values, error=error)
        for values, error in zip(settings, largest, strict=True)
    )


def rows_of_kinds(
    settings: Sequence[Sequence[SettingValues]], errors: Sequence[Sequence[float]]
) -> tuple[SettingRow, ...]:
    """The same where inputs have settings of their own: the largest over those that share them."""
    largest: dict[tuple[tuple[str, object], ...], float] = {}
    for values, error in zip(chain(*settings), chain(*errors), strict=True):
        key = tuple(values.items())
        largest[key] = max(largest.get(key, 0.0), error)
    return tuple(SettingRow(values=dict(key), error=error) for key, error in largest.items())
