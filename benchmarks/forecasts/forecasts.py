"""Forecasts of five commands against what they take, on inputs that no rate was fitted to.

Run ``python -m benchmarks.forecasts.forecasts FOLDER`` (needs scikit-image's photographs); prints
Markdown. The folder is the one of ``limits.py``, or a new one that gets the same inputs. Compared
are processor seconds and peak memory, so that other programs on the machine do not count.
"""

import argparse
import os
from pathlib import Path

from benchmarks.forecasts.limits import make_photos, make_scenes
from diff4splat.cli.calibration.measured_process import measure_process
from diff4splat.cli.limits.command_work import command_work
from diff4splat.cli.limits.costing import Costing
from diff4splat.outputs.budgets.costs import FREE_CORES

MEASURES = (("cpu_seconds", 1.0, "s"), ("memory_bytes", 1e6, "MB"))


def commands(folder: Path) -> dict[str, list[str]]:
    """Each run's words, with the place of its result, by what it is."""
    photos = make_photos(folder)
    scenes = make_scenes(folder, photos)
    world, clock = str(photos[1]), str(folder / "clock.png")
    small = ["--resolution", "192", "--frames", "17", "--skip-depth", "--infill", "none"]
    path = ["--camera", "arc:0.1", "--frames", "60", "--resolution", "320"]
    steps = ["--set", "coarse_steps=120", "--steps", "250", "--restart"]
    return {
        "`generate`, 320², 25 frames, spiral": [
            *("generate", world, "--resolution", "320", "--frames", "25"),
            *("--out", str(folder / "forecast-large")),
        ],
        "`generate`, 192², 17 frames, no depth, no infill": [
            *("generate", clock, *small, "--out", str(folder / "forecast-small")),
        ],
        "`render`, some Gaussians move, 60 frames of 320²": [
            *("render", str(scenes[0]), *path, "--out", str(folder / "forecast.webm")),
        ],
        "`bake`, HexPlane, 0.3 px": [
            *("bake", str(scenes[2]), "--tolerance-px", "0.3"),
            *("--out", str(folder / "forecast-bake.safetensors")),
        ],
        "`fit`, HexPlane, 72², 120 and 250 steps": [
            *("fit", str(folder / "capture"), *steps, "--out", str(folder / "forecast-fit")),
        ],
    }


def compare(name: str, arguments: list[str]) -> str:
    """A row of the table."""
    expected = Costing.of().forecast(*command_work(arguments))
    run = measure_process(arguments)
    cells = [name]
    for key, unit, symbol in MEASURES:
        before, after = getattr(expected, key) / unit, getattr(run, key) / unit
        cells.append(f"{before:.3g} {symbol}")
        cells.append(f"{after:.3g} {symbol} ({100 * (before / after - 1):+.0f} %)")
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Make the inputs, then forecast and run each command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of inputs and results")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    os.environ[FREE_CORES] = "1"
    print("| run | expected | measured | memory, expected | measured |\n|---|---:|---:|---:|---:|")
    for name, arguments in commands(folder).items():
        print(compare(name, arguments), flush=True)


if __name__ == "__main__":
    main()
