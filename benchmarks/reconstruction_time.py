"""Seconds from a true video to its scene: autoencoder, LDRM, deformation and photometric steps.

Run ``python benchmarks/reconstruction_time.py --out FILE.md``; prints Markdown. The median of
several runs after one that does not count.
"""

import argparse
import statistics
import time
from dataclasses import replace
from pathlib import Path

import torch

from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.video.video_to_scene import scene_from_video
from diff4splat.io.atomic import write_text
from diff4splat.io.pixels import unit_rgb
from diff4splat.models.hub.model import Model, load_model
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.machine import this_machine


def held_out_video(side: int) -> tuple[torch.Tensor, CameraPath]:
    """What reconstruction is given of the first held-out clip."""
    loaded = load_protocol("held_out_v2")
    loaded = replace(loaded, protocol=loaded.protocol.at_size((side, side)))
    clip, shown = open_clips(loaded).clip(0), slice(None, None, loaded.protocol.input_stride)
    view = clip.views[0]
    path = CameraPath(cameras=view.cameras[shown].to(torch.float32), times_s=clip.times_s[shown])
    return unit_rgb(view.rgb[shown]), path


def seconds_row(model: Model, side: int, steps: list[int], runs: int) -> list[str]:
    """Seconds of a video of one size, with each number of photometric steps."""
    video, path = held_out_video(side)
    cells = []
    for settings in (GenerationSettings(photometric_steps=one) for one in steps):
        seconds = []
        for _ in range(runs + 1):
            start = time.perf_counter()
            scene = scene_from_video(model, video, path, settings)
            seconds.append(time.perf_counter() - start)
        cells.append(f"{statistics.median(seconds[1:]):.2f}")
    return [f"{side} px", str(len(video)), f"{len(scene.gaussians):,}", *cells]


def main() -> None:
    """One line per size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="small")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--photometric-steps", type=int, nargs="+", default=[0, 5, 15, 40])
    parser.add_argument("--out", type=Path, help="markdown file")
    options = parser.parse_args()
    model = load_model(options.model)
    head = [f"{steps} steps [s]" for steps in options.photometric_steps]
    rows = [["size", "frames", "Gaussians", *head], ["---:"] * (3 + len(head))]
    for side in (model.config.size_px[0], 2 * model.config.size_px[0]):
        rows.append(seconds_row(model, side, options.photometric_steps, options.runs))
    lines = [f"| {' | '.join(row)} |" for row in rows]
    text = "\n".join(lines) + f"\n\n{this_machine()}.\n"
    print(text)
    if options.out:
        write_text(options.out, text)


if __name__ == "__main__":
    main()
