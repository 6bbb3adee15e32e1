"""What a reconstruction is worth as the start of a fit.

Usage: python -m benchmarks.reconstruction.fit_start CLIPS

CLIPS are worlds of 128 px with two views (``prepare synth --views 2``). The first is a video of one
moving camera, from which all rows learn, at 64 px and without depth; the second is held out. Rows:
the reconstruction alone, a fit, and a fit that starts from the reconstruction.
"""

import argparse
import json
import tempfile
from collections import defaultdict
from pathlib import Path

import torch

from diff4splat.cli.main import run
from diff4splat.data.capture.capture import Capture
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import read_capture
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.metrics.image import psnr
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene

HELD_OUT, DOWNSCALE = 1, 2


@torch.no_grad()
def held_out_db(scene: Scene, capture: Capture) -> float:
    """Mean PSNR of the held-out frames."""
    values = []
    for index in capture.held_out.nonzero().flatten().tolist():
        camera = capture.cameras[index].to(torch.float32)
        view = render(scene, camera, float(capture.times_s[index])).rgb.clamp(0, 1)
        values.append(psnr(view, capture.frames.read(index).rgb))
    return float(torch.stack(values).mean())


def rows_of(clips: Path, name: str, steps: int, folder: Path) -> dict[str, float]:
    """PSNR of the held-out view by row."""
    given = ["--clip", name, "--hold-out", str(HELD_OUT), "--downscale", str(DOWNSCALE)]
    _run(["reconstruct", str(clips), *given, "--out", str(folder / "start")])
    start = folder / "start/scene.safetensors"
    options = ReadOptions(clip=name, hold_out=(HELD_OUT,), downscale=DOWNSCALE)
    rows = {"reconstruct": held_out_db(load_scene(start), read_capture(clips, options))}
    for row, more in (("fit", []), ("reconstruct, fit", ["--init", str(start)])):
        out = folder / row
        fit = ["fit", str(clips), *given, "--no-depth", "--steps", str(steps), "--out", str(out)]
        _run([*fit, *more])
        card = json.loads((out / "card.json").read_text())
        rows[row] = card["held_out"]["psnr_db"]
        rows[f"{row}: seconds"] = card["seconds_fitting"]
    return rows


def _run(arguments: list[str]) -> None:
    if code := run(arguments):
        raise SystemExit(code)


def main() -> None:
    """Print a row per clip, and the means."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", type=Path)
    parser.add_argument("--most", type=int, default=6)
    parser.add_argument("--steps", type=int, default=400)
    options = parser.parse_args()
    values: dict[str, list[float]] = defaultdict(list)
    for name in ClipFolder(options.clips).identifiers[: options.most]:
        with tempfile.TemporaryDirectory() as folder:
            rows = rows_of(options.clips, name, options.steps, Path(folder))
        print(name, {key: round(value, 2) for key, value in rows.items()}, flush=True)
        for key, value in rows.items():
            values[key].append(value)
    print({key: round(sum(each) / len(each), 2) for key, each in values.items()})


if __name__ == "__main__":
    main()
