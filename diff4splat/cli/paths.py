"""``diff4splat paths``: list the presets, check and draw a path; no model is loaded."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from diff4splat.cli.options.camera import CameraOptions, choose_path, require_camera
from diff4splat.cli.options.constraints import Number, OutputFile
from diff4splat.cli.options.guard_overwrite import require_inputs_not_overwritten

if TYPE_CHECKING:
    from diff4splat.paths.summary import PathSummary

PREVIEW_SIZE_PX = (360, 640)
IMAGE_SUFFIXES = (".png", ".svg", ".pdf")


@dataclass(frozen=True, kw_only=True)
class PreviewPath:
    """Check a camera path and draw it."""

    camera: Annotated[str, tyro.conf.Positional]
    """Camera presets such as `spiral` or `orbit:0.25+up`, or a path file."""
    out: Annotated[Path, OutputFile(suffixes=IMAGE_SUFFIXES), tyro.conf.arg(aliases=("-o",))] = (
        Path("path.png")
    )
    """Image file for the drawing."""
    fov: Annotated[float, Number(least=1, most=170)] = 62.0
    """Horizontal field of view in degrees, for presets and files without a lens."""
    near_depth: Annotated[float, Number(above=0)] = 1.0
    """Distance of the nearest content, which sets the size of presets."""
    options: Annotated[CameraOptions, tyro.conf.arg(name="")] = field(default_factory=CameraOptions)

    def check(self) -> None:
        """Check the path's names, or its file."""
        require_inputs_not_overwritten((Path(self.camera),), (self.out,))
        require_camera(self.camera, self.options)

    def run(self) -> None:
        """Print statistics of the path, then write the drawing."""
        from diff4splat.cli.common.console import note
        from diff4splat.geometry.camera import focal_from_fov, pinhole
        from diff4splat.outputs.path_plot import save_path_preview
        from diff4splat.paths.settings import PathFrame
        from diff4splat.paths.summary import summarize

        camera = pinhole(focal_from_fov(self.fov, PREVIEW_SIZE_PX[1]), PREVIEW_SIZE_PX)
        view = PathFrame(camera=camera, near_depth=self.near_depth, focus_depth=self.near_depth)
        path = choose_path(self.camera, view, self.options)
        print_summary(summarize(path, self.near_depth))
        save_path_preview(path, self.out, self.camera)
        note(f"drew {self.out}")


def print_summary(summary: "PathSummary") -> None:
    """Print statistics and warnings of a camera path."""
    low, high = summary.focal_range_px
    focal = f"{low:.4g} to {high:.4g} px" if high > low else f"{low:.4g} px"
    facts = {
        "frames": f"{summary.frames} in {summary.seconds:.3g} s",
        "travel": f"{summary.travel:.3g} units, at most {summary.farthest:.3g} from the start",
        "largest step": f"{summary.largest_step:.3g} units",
        "turn": f"{summary.turn_deg:.3g} degrees, at most {summary.largest_turn_deg:.3g} per frame",
        "focal length": f"{focal} in an image of {summary.size_px[1]} by {summary.size_px[0]} px",
    }
    for name, value in facts.items():
        print(f"{name:<14}{value}")
    for warning in summary.warnings:
        print(f"warning       {warning}")


@dataclass(frozen=True, kw_only=True)
class ListPaths:
    """List the camera presets."""

    def run(self) -> None:
        """Print one line per preset."""
        from diff4splat.paths.presets import PRESETS

        for name, preset in PRESETS.items():
            print(f"{name:<12} {preset.summary}")
