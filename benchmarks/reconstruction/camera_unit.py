"""Whether the unit of cameras is found: ``python -m benchmarks.reconstruction.camera_unit CLIPS``.

CLIPS are worlds (``prepare synth``), whose true depth gives the true unit. Of each the input
camera's video is reconstructed with the unit that is found, with the true one, and with others.
Columns: the median depth of the first frame over the true one, and the relative error of the depth
that the scene has at that frame, in the unit of the cameras.
"""

import argparse
import math
from pathlib import Path

import torch
from torch import Tensor

from diff4splat.data.capture.capture import Capture
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.generation.inputs.input_video import InputVideo, VideoChoice, choose_video
from diff4splat.generation.reconstruction import reconstruct
from diff4splat.models.hub.model import Model, load_model
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Times the true unit."""


def true_depth(capture: Capture, video: InputVideo) -> Tensor:
    """Of the first frame, by nearest pixel, at the size of the networks; 0 where there is none."""
    depth = capture.frames.read(int(video.index[0])).depth
    size = tuple(video.rgb.shape[1:3])
    return torch.nn.functional.interpolate(depth[None, None], size, mode="nearest")[0, 0]


def measure(model: Model, capture: Capture) -> dict[str, float]:
    """The ratio of the unit that was found, and errors by unit; nothing if the video shows none."""
    video = choose_video(capture, VideoChoice())
    truth = true_depth(capture, video)
    median = float(truth[truth > 0].median())
    result = reconstruct(model, video)
    if not result.scale.observable:
        return {}
    row = {"ratio": result.scale.median_depth / median, "found": error(result.scene, truth)}
    for factor in FACTORS:
        row[f"{factor:g}"] = error(reconstruct(model, video, factor * median).scene, truth)
    return row


def error(scene: Scene, truth: Tensor) -> float:
    """Mean relative error of the depth at the first frame, in the unit of the cameras."""
    path = scene.path
    depth = render(scene, path.cameras[0], float(path.times_s[0]), outputs=("depth",)).depth
    known = truth > 0
    return float(((depth - truth).abs() / truth)[known].mean())


def main() -> None:
    """Print a row per clip, and the means."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", type=Path)
    parser.add_argument("--model", default="small")
    parser.add_argument("--most", type=int, default=24)
    options = parser.parse_args()
    model, rows = load_model(options.model, ()), []
    folder = ClipFolder(options.clips)
    for index in range(min(len(folder), options.most)):
        name = folder.identifiers[index]
        capture = read_capture(options.clips, ReadOptions(clip=name))
        row = measure(model, capture)
        rows += [row] if row else []
        print({key: round(value, 3) for key, value in row.items()}, flush=True)
    logs = torch.tensor([abs(math.log(row["ratio"])) for row in rows])
    print(f"{len(rows)} of {min(len(folder), options.most)} videos show a unit")
    print("| unit found: median error, 90 % | " + " | ".join(rows[0]) + " |")
    means = [sum(row[key] for row in rows) / len(rows) for key in rows[0]]
    errors = [f"{math.expm1(float(logs.quantile(share))):.0%}" for share in (0.5, 0.9)]
    print(f"| {', '.join(errors)} | " + " | ".join(f"{mean:.3f}" for mean in means) + " |")


if __name__ == "__main__":
    main()
