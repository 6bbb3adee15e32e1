"""Errors of settings on one scene: frames against those of the reference setting."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

from diff4splat.cli.limits import baking, exporting, rendering
from diff4splat.cli.limits.measured import frame_error
from diff4splat.io.scene_files.motion_tensors import pack_motion
from diff4splat.outputs.budgets.table import SettingValues

if TYPE_CHECKING:
    from torch import Tensor

    from diff4splat.scene.scene import Scene


def scene_errors(scene: "Scene") -> dict[str, list[float]]:
    """Errors of all settings of the commands that read a scene."""
    moving = len(scene.motion.moving_index) > 0
    return {
        "render": render_errors(scene),
        "export html": html_errors(scene),
        "bake": bake_errors(scene) if moving else [],
    }


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


def mean_error(frames: Sequence["Tensor"], exact: Sequence["Tensor"]) -> float:
    """Mean square difference over all frames."""
    pairs = list(zip(frames, exact, strict=True))
    return sum(frame_error(frame, one) for frame, one in pairs) / len(pairs)
