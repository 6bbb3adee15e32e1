"""``diff4splat bake``: convert any motion to keyframes, and report the error."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.cli.limits.options import LimitOptions
from diff4splat.cli.options.constraints import InputPath, Number, OutFile
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten

if TYPE_CHECKING:
    from diff4splat.geometry.camera import Camera


@dataclass(frozen=True, kw_only=True)
class Bake:
    """Convert the motion of a scene to keyframes, which every viewer can read."""

    scene: Annotated[Path, tyro.conf.Positional, InputPath(what="a scene file", folder=False)]
    """A scene file, such as the result of `diff4splat fit`."""
    out: OutFile
    """Scene file to write."""
    tolerance_px: Annotated[float | None, Number(above=0)] = None
    """Largest position error of any Gaussian, in pixels of the scene's cameras. Default: 0.1, or
    what --tolerance and --budget allow."""
    keys: Annotated[int | None, Number(least=1)] = None
    """Number of evenly spaced keyframes, instead of a tolerance."""
    limits: Annotated[LimitOptions, tyro.conf.arg(name="")] = field(default_factory=LimitOptions)

    def check(self) -> None:
        """Require another file than the input."""
        require_inputs_not_overwritten((self.scene,), (self.out,))

    def run(self) -> None:
        """Load, bake, report the error, write."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.cli.limits.baking import chosen_px, measured_loss_db, promise
        from diff4splat.cli.limits.stopwatch import Stopwatch
        from diff4splat.io.scene_files.scene_file import load_scene, save_scene
        from diff4splat.scene.motion.bake import bake, bake_within

        promised, watch = promise(self), Stopwatch.of_process()
        for line in promised.lines():
            note(line)
        scene = load_scene(self.scene)
        cameras = unique_views(scene.path.cameras)
        with ConsolePhases().phase("bake"):
            if self.keys is None:
                baked, error = bake_within(
                    scene.gaussians, scene.motion, cameras, chosen_px(self, promised)
                )
            else:
                baked, error = bake(scene.gaussians, scene.motion, self.keys, cameras)
        made = replace(scene, motion=baked)
        save_scene(made, self.out)
        measured = watch.read()
        if promised.limits.tolerance_db is not None:
            measured["loss_db"] = measured_loss_db(scene, made)
        note(
            f"{len(baked.key_times_s)} key times for {len(baked.moving_index):,} Gaussians: at "
            f"most {error.largest_px:.3g} px off, 99.9 % below {error.quantile_px:.3g} px"
        )
        if max(error.opacity_lost, error.color_lost) > 0:
            note(
                "key frames hold neither opacity nor colour; left out: changes of up to "
                f"{error.opacity_lost:.3g} in opacity and {error.color_lost:.3g} in harmonics"
            )
        for line in promised.after(measured):
            note(line)
        note(f"wrote {self.out}")


def unique_views(cameras: "Camera") -> "Camera":
    """Each view once: a static camera has the same view in every frame."""
    import torch

    views = torch.cat([cameras.world_from_camera.flatten(1), cameras.focal_px], 1)
    _, groups = views.unique(dim=0, return_inverse=True)
    first = [int((groups == group).nonzero()[0]) for group in range(int(groups.max()) + 1)]
    return cameras[torch.tensor(sorted(first))]
