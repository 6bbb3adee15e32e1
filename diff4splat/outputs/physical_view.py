"""One file that shows a scene through a physical camera: a video, .png or .exr.

Axes: ``t`` frames, ``h w`` pixels.
"""

import json
from pathlib import Path

import torch

from diff4splat.io.cameras.optics_json import optics_json
from diff4splat.io.exr import write_depth_exr
from diff4splat.io.movies.movie import write_movie
from diff4splat.io.movies.suffixes import is_movie
from diff4splat.io.photos.images import write_png
from diff4splat.outputs.photo_sequence import CaptureStats, geometry_kind, render_photographs
from diff4splat.outputs.scene_folder import frames_per_second, require_view_suffix
from diff4splat.paths.physical_path import PhysicalPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.scene.scene import Scene


def write_physical_view(
    scene: Scene, physical_path: PhysicalPath, file: Path, settings: PhotoSettings, log: RunLog
) -> CaptureStats:
    """Take every frame into one file whose suffix says what it holds; returns what they needed.

    Raises:
        ConfigError: another suffix.
        OutputError: the file cannot be written.
    """
    suffix = require_view_suffix(file)
    kind, taken = geometry_kind(physical_path), CaptureStats()
    wanted = (kind,) if suffix == ".exr" else ("rgb",)
    with log.phases.phase("render", len(physical_path)) as advance:
        frames = render_photographs(scene, physical_path, wanted, settings, advance, taken)
        if is_movie(file):
            rgb = (frame.rgb for frame in frames)
            taken.notes += write_movie(rgb, file, frames_per_second(physical_path.path))
        elif suffix == ".png":
            write_png(next(frames).rgb, file)
        else:
            values = torch.stack([getattr(frame, kind) for frame in frames])
            optics = json.dumps(optics_json(physical_path.optics))
            write_depth_exr(values, physical_path.path, file, quantity=kind, optics=optics)
    return taken
