"""Errors of settings on the inputs of a calibration: frames against those of the reference."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, product
from pathlib import Path
from typing import TYPE_CHECKING

from diff4splat.cli.limits import baking, exporting, generation, rendering
from diff4splat.cli.limits.measured import frame_error
from diff4splat.io.scene_files.motion_tensors import pack_motion
from diff4splat.outputs.budgets.table import SettingRow, SettingValues

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.generation.pipeline import Diff4SplatPipeline
    from diff4splat.scene.scene import Scene

CAMERA, FRAMES, SEED, SIDE_PX = "arc:0.1", 3, 0, 192


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


def photo_errors(photo: Path) -> list[float]:
    """Share of the photograph's detail that each setting of ``generate`` loses."""
    from diff4splat.generation.inputs.image_detail import image_detail

    reference = {"side_share": 1.0, "color_matching_steps": generation.REFERENCE_STEPS}
    exact = generated_frames(photo, reference)
    detail = image_detail(exact[0].clamp(0, 1))
    return [
        mean_error(generated_frames(photo, values), exact) / detail
        for values in generation_settings()
    ]


def render_settings() -> list[SettingValues]:
    """Every setting of ``render`` that a limit may choose."""
    return [
        {"side_share": share, "alpha_cutoff": cutoff}
        for share, cutoff in product(rendering.SIDE_SHARES, rendering.CUTOFFS)
    ]


def render_errors(scene: "Scene") -> list[float]:
    """Error of each setting of ``render``; of smaller frames, its share of their detail."""
    exact = ViewFrames.exact(scene)
    return [
        exact.error(scene, values) / rendering.error_unit(values, exact.detail)
        for values in render_settings()
    ]


def bake_settings(scene: "Scene") -> list[SettingValues]:
    """Every tolerance, for the scene's kind of motion."""
    kind = pack_motion(scene.motion).settings["kind"]
    return [{"motion": kind, "tolerance_px": px} for px in baking.TOLERANCES_PX]


def bake_errors(scene: "Scene") -> list[float]:
    """Error of frames from key frames, for each tolerance."""
    exact = baking.path_frames(scene)
    return [
        mean_error(baking.path_frames(baked(scene, values["tolerance_px"])), exact)
        for values in bake_settings(scene)
    ]


def baked(scene: "Scene", tolerance_px: float) -> "Scene":
    """The scene with key frames within a tolerance."""
    from diff4splat.cli.scenes.bake import unique_views
    from diff4splat.scene.motion.bake import bake_within

    views = unique_views(scene.path.cameras)
    motion, _ = bake_within(scene.gaussians, scene.motion, views, tolerance_px)
    return replace(scene, motion=motion)


def html_settings() -> list[SettingValues]:
    """Every setting of ``export html`` that a limit may choose."""
    return [
        {"min_opacity": opacity, "degree": degree}
        for opacity, degree in product(exporting.MIN_OPACITIES, exporting.DEGREES)
    ]


def html_errors(scene: "Scene") -> list[float]:
    """Error of what each page leaves out; degrees that the scene lacks leave out nothing."""
    exact, own = baking.path_frames(scene), scene.gaussians.degree
    known: dict[tuple[float, int], float] = {}
    for values in html_settings():
        key = (values["min_opacity"], min(values["degree"], own))
        if key not in known:
            known[key] = mean_error(baking.path_frames(exporting.reduced(scene, values)), exact)
    return [known[values["min_opacity"], min(values["degree"], own)] for values in html_settings()]


@dataclass(frozen=True, kw_only=True)
class ViewFrames:
    """Frames of the reference setting of ``render``, made once for all others."""

    indices: tuple[int, ...]
    frames: tuple["Tensor", ...]

    @classmethod
    def exact(cls, scene: "Scene") -> "ViewFrames":
        """At a quarter, half and three quarters of the scene's path."""
        count = len(scene.path)
        indices = tuple(sorted({count // 4, count // 2, 3 * count // 4}))
        values = {"side_share": 1.0, "alpha_cutoff": min(rendering.CUTOFFS)}
        return cls(indices=indices, frames=tuple(view_frames(scene, values, indices)))

    @property
    def detail(self) -> float:
        """Of the frame in the middle."""
        from diff4splat.generation.inputs.image_detail import image_detail

        return image_detail(self.frames[len(self.frames) // 2].clamp(0, 1))

    def error(self, scene: "Scene", values: SettingValues) -> float:
        """Mean square difference of another setting."""
        return mean_error(view_frames(scene, values, self.indices), self.frames)


def view_frames(scene: "Scene", values: SettingValues, indices: Sequence[int]) -> list["Tensor"]:
    """Frames of the scene's path at a setting of ``render``."""
    from diff4splat.render.api import DEFAULTS, render

    settings = replace(DEFAULTS, alpha_cutoff=values["alpha_cutoff"])
    path = rendering.at_share(scene.path, values["side_share"])
    return [
        render(scene, path.cameras[k], float(path.times_s[k]), settings=settings).rgb
        for k in indices
    ]


def generated_frames(
    photo: Path,
    values: SettingValues,
    model: str = "small",
    side_px: int = SIDE_PX,
    camera: str = CAMERA,
) -> list["Tensor"]:
    """Frames of a generation with a setting, at its own size."""
    from diff4splat.generation.inputs.image_size import find_image_size
    from diff4splat.generation.inputs.input_cameras import path_frame
    from diff4splat.generation.inputs.input_image import load_image
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
    scene = _pipeline(model)(image, path, seed=SEED, settings=settings)
    return [frame.rgb for frame in render_video(scene, scene.path)]


def mean_error(frames: Sequence["Tensor"], exact: Sequence["Tensor"]) -> float:
    """Mean square difference over all frames."""
    pairs = list(zip(frames, exact, strict=True))
    return sum(frame_error(frame, one) for frame, one in pairs) / len(pairs)


def scene_errors(scene: "Scene") -> dict[str, list[float]]:
    """Errors of all settings of the commands that read a scene."""
    moving = len(scene.motion.moving_index) > 0
    return {
        "render": render_errors(scene),
        "export html": html_errors(scene),
        "bake": bake_errors(scene) if moving else [],
    }


def all_rows(
    photos: Sequence[Sequence[float]],
    scenes: Sequence["Scene"],
    found: Sequence[Mapping[str, Sequence[float]]],
) -> dict[str, tuple[SettingRow, ...]]:
    """Rows of every command, from ``photo_errors`` and ``scene_errors`` of the inputs."""
    moving = [len(scene.motion.moving_index) > 0 for scene in scenes]
    settings = [
        bake_settings(scene) if moves else [] for scene, moves in zip(scenes, moving, strict=True)
    ]
    return {
        "generate": worst_rows(generation_settings(), photos),
        "render": worst_rows(render_settings(), [one["render"] for one in found]),
        "export html": worst_rows(html_settings(), [one["export html"] for one in found]),
        "bake": rows_of_kinds(settings, [one["bake"] for one in found]),
    }


@cache
def _pipeline(model: str) -> "Diff4SplatPipeline":
    """Weights are read once for all settings."""
    from diff4splat.generation.pipeline import Diff4SplatPipeline

    return Diff4SplatPipeline.from_pretrained(model)


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
