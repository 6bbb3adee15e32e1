"""The main path on real photographs: fidelity, geometry, files, seconds and memory.

Run ``python benchmarks/photographs.py`` (needs scikit-image's photographs); prints Markdown, and
with ``--pictures FOLDER`` writes a strip of each as it came out. Every photograph goes through
``small`` in a process of its own, so that peak memory is its own.

    first view     PSNR of the first frame against the photograph at the scene's size
    orbit          least share of a frame that shows something, 15 degrees to both sides, and
                   whether every number is finite
    geometry       median error of the measured optical flow (OpenCV DIS, textured half of the
                   image) against the flow of the predicted depth, after a step to the left
    file, PLY      PSNR of a frame rendered from the re-read file against the one in memory
    same bits      whether a second run with the same seed gives an equal scene file
"""

import argparse
import multiprocessing
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from diff4splat.generation.inputs.image_size import find_image_size
from diff4splat.generation.inputs.input_image import InputImage, choose_focal, prepare_image
from diff4splat.generation.pipeline import Diff4SplatPipeline
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject
from diff4splat.geometry.rays import pixel_centers
from diff4splat.io.photos.images import write_png
from diff4splat.io.ply.ply_file import read_ply, write_ply
from diff4splat.io.scene_files.scene_file import load_scene, save_scene
from diff4splat.metrics.image import psnr
from diff4splat.paths.build import build_path
from diff4splat.paths.settings import PathSettings
from diff4splat.progress.phases import peak_memory_bytes
from diff4splat.render.api import render, render_video
from diff4splat.render.settings import RenderSettings
from diff4splat.scene.extent import scene_frame
from diff4splat.scene.scene import Scene

SIDE_PX = 256
PHOTOGRAPHS = ("astronaut", "coffee", "chelsea", "rocket")
CAMERA = "left:0.05"
ORBITS = ("orbit:0.0417", "orbit:-0.0417")
"""15 of 360 degrees to each side."""
ORBIT_FRAMES, SHOWN = 5, 0.5
"""Frames per side, and the coverage from which a pixel shows something."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What one photograph gave."""

    name: str
    size_px: tuple[int, int]
    first_view_db: float
    orbit_share: float
    orbit_finite: bool
    strip: Float[np.ndarray, "h w 3"]
    """No tensor: its memory would end with the process that measured it."""
    flow_px: float
    flow_error_px: float
    file_db: float
    ply_db: float
    same_bits: bool
    generate_s: float
    frame_ms: float
    peak_gib: float


def measure(name: str) -> Row:
    """Everything about one photograph."""
    picture = load(name)
    pipeline = Diff4SplatPipeline.from_pretrained("small")
    start = time.perf_counter()
    scene = pipeline(picture, CAMERA)
    generate_s = time.perf_counter() - start
    peak_gib = peak_memory_bytes() / 2**30
    start = time.perf_counter()
    frames = list(render_video(scene, scene.path))
    frame_ms = (time.perf_counter() - start) / len(frames) * 1e3
    flow_px, flow_error_px = flow_error(scene)
    file_db, ply_db, same_bits = through_files(scene, pipeline(picture, CAMERA))
    share, finite, strip = around(scene, picture)
    return Row(
        orbit_share=share,
        orbit_finite=finite,
        strip=strip.numpy(),
        name=name,
        size_px=picture.camera.size_px,
        first_view_db=float(psnr(frames[0].rgb.clamp(0, 1), picture.rgb)),
        flow_px=flow_px,
        flow_error_px=flow_error_px,
        file_db=file_db,
        ply_db=ply_db,
        same_bits=same_bits,
        generate_s=generate_s,
        frame_ms=frame_ms,
        peak_gib=peak_gib,
    )


def load(name: str) -> InputImage:
    """A photograph of scikit-image at the default size of ``small``."""
    import skimage.data

    rgb = torch.from_numpy(getattr(skimage.data, name)()).float() / 255
    focal = choose_focal((rgb.shape[0], rgb.shape[1]), None, None)
    return prepare_image(rgb, focal, *find_image_size("small", SIDE_PX))


def around(scene: Scene, picture: InputImage) -> tuple[float, bool, Float[Tensor, "h w 3"]]:
    """Least share of a frame that shows something, whether all is finite, and frames in a row."""
    shares, finite, frames = [], True, []
    view = scene_frame(scene, picture.camera)
    for orbit in ORBITS:
        settings = PathSettings(frames=ORBIT_FRAMES, fps=ORBIT_FRAMES - 1)
        for camera in build_path(orbit, view, settings).cameras:
            seen = render(scene, camera, outputs=("rgb", "alpha", "depth"))
            shares.append(float((seen.alpha > SHOWN).float().mean()))
            finite &= all(bool(part.isfinite().all()) for part in (seen.rgb, seen.depth))
            frames.append(seen.rgb.clamp(0, 1))
    last = ORBIT_FRAMES - 1
    chosen = (picture.rgb, frames[0], frames[last // 2], frames[last], frames[-1])
    return min(shares), finite, torch.cat(chosen, 1)


def flow_error(scene: Scene) -> tuple[float, float]:
    """Mean length of the expected flow and median error of the measured one, in pixels."""
    start, stop = scene.path.cameras[0], scene.path.cameras[-1]
    first = render(scene, start, outputs=("rgb", "depth"))
    pixels = project(stop, unproject(start, first.depth).flatten(0, 1))[0]
    expected = pixels.unflatten(0, first.depth.shape) - pixel_centers(start.size_px, pixels)
    before, after = (
        (rgb.clamp(0, 1).mean(-1) * 255).byte().numpy()
        for rgb in (first.rgb, render(scene, stop).rgb)
    )
    solver = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    measured = torch.from_numpy(solver.calc(before, after, None))
    inner = (slice(24, -24), slice(24, -24))
    smooth = torch.from_numpy(cv2.GaussianBlur(before, (0, 0), 1)).float()[inner]
    rows, columns = torch.gradient(smooth)
    textured = (strength := rows**2 + columns**2) > strength.median()
    error = (measured - expected)[inner].norm(dim=-1)[textured]
    return float(expected[inner].norm(dim=-1).mean()), float(error.median())


def through_files(scene: Scene, again: Scene) -> tuple[float, float, bool]:
    """Fidelity after the scene file and after PLY, and whether a second run has equal bits."""
    camera = scene.path.cameras[-1]
    expected = render(scene, camera).rgb
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("a.safetensors", "b.safetensors", "a.ply")]
        save_scene(scene, files[0])
        save_scene(again, files[1])
        write_ply(scene.state_at(0.0), files[2])
        from_file = render(load_scene(files[0]), camera).rgb
        # A PLY cannot say what dilation a scene was made for.
        asked = RenderSettings(dilation_px2=scene.dilation_px2)
        from_ply = render(read_ply(files[2]), camera, settings=asked).rgb
        same_bits = files[0].read_bytes() == files[1].read_bytes()
    return float(psnr(from_file, expected)), float(psnr(from_ply, expected)), same_bits


def main() -> None:
    """Measure every photograph and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path, help="folder for a strip of each photograph")
    options = parser.parse_args()
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        rows = pool.map(measure, PHOTOGRAPHS, chunksize=1)
    print(
        "| photograph | size | first view | orbit | flow | flow error | file | PLY | same bits | "
        "generate | frame | peak memory |\n|---|---|---|---|---|---|---|---|---|---|---|---|"
    )
    for row in rows:
        height, width = row.size_px
        if options.pictures:
            write_png(torch.from_numpy(row.strip), options.pictures / f"photograph-{row.name}.png")
        print(
            f"| {row.name} | {width}×{height} | {row.first_view_db:.1f} dB "
            f"| {row.orbit_share:.1%}{'' if row.orbit_finite else ', not finite'} "
            f"| {row.flow_px:.1f} px "
            f"| {row.flow_error_px:.2f} px | {row.file_db:.0f} dB | {row.ply_db:.0f} dB "
            f"| {'yes' if row.same_bits else 'no'} | {row.generate_s:.1f} s "
            f"| {row.frame_ms:.0f} ms | {row.peak_gib:.2f} GiB |"
        )


if __name__ == "__main__":
    main()
