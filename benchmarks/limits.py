"""Random requests with a tolerance or a budget: how many hold, and by how much the others miss.

Run ``python benchmarks/limits.py`` (needs scikit-image's photographs); prints Markdown. Requests
come from a seed. Inputs are none of those that the calibration that ships was measured on.

    tolerance   every frame of the chosen setting against the reference setting, as a loss in dB
    budget      a process of its own, its seconds by the clock and its peak memory

A request that the command refuses, as no setting holds it, is drawn again and counted.
"""

import argparse
import json
import random
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
from skimage import data

from diff4splat.cli.calibration import calibration_errors
from diff4splat.cli.calibration.calibration_inputs import draw_photos
from diff4splat.cli.calibration.measured_process import measure_process
from diff4splat.cli.common.parser import parse
from diff4splat.cli.limits import baking, exporting, generation, rendering
from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.errors import ConfigError
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.outputs.budgets.limits import loss_from_error

PHOTOGRAPHS = ("camera", "brick", "coins", "grass", "moon", "clock")
WORLDS = ((101, 2), (103, 7), (107, 4), (109, 1))
SIDE_PX = 256
TOLERANCES_DB = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
KINDS = (
    *(("render", "tolerance"),) * 9,
    *(("bake", "tolerance"),) * 4,
    *(("export html", "tolerance"),) * 5,
    *(("generate", "budget"),) * 5,
    *(("render", "budget"),) * 5,
    *(("generate", "tolerance"),) * 12,
)
SPARE = (1.3, 4.0)
"""Budgets are what the default needs by the forecast, times a number in this range."""
MISS = 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """One request and what came of it."""

    command: str
    source: str
    limit: str
    setting: str
    measured: str
    ratio: float
    """Measured over allowed, the largest; 1 or below holds."""


def make_photos(folder: Path) -> list[Path]:
    """Unseen photographs, small and grey ones in RGB, and unseen worlds."""
    photos = draw_photos(folder, WORLDS)
    for name in PHOTOGRAPHS:
        image = getattr(data, name)()
        grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        height, width = grey.shape
        scale = SIDE_PX / (height * width) ** 0.5
        small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        photos.append(folder / f"{name}.png")
        cv2.imwrite(str(photos[-1]), cv2.cvtColor(small, cv2.COLOR_GRAY2BGR))
    return photos


def make_scenes(folder: Path, photos: list[Path]) -> list[Path]:
    """Generated scenes that move and do not, and two short fits of an unseen clip."""
    capture = folder / "capture"
    rig = ("--rig", "--size", "72", "--frames", "9", "--views", "5", "--clips", "1")
    measure_process(["prepare", "synth", *rig, "--seed", "5", "--out", str(capture)])
    runs = [
        ("generate", str(photos[0]), "--frames", "17", "--prompt", "a block slides to the right"),
        ("generate", str(photos[5]), "--frames", "17"),
        ("fit", str(capture), "--steps", "300", "--budget", "4000", "--set", "coarse_steps=200"),
        ("fit", str(capture), "--motion", "spacetime", "--steps", "300", "--budget", "3000"),
    ]
    for n, arguments in enumerate(runs):
        measure_process([*arguments, "--out", str(folder / f"scene-{n}")])
    return [folder / f"scene-{n}" / "scene.safetensors" for n in range(len(runs))]


def within_tolerance(name: str, source: Path, loss_db: float, draw: random.Random) -> Held:
    """Choose by a tolerance, and measure the loss."""
    tolerance = ("--tolerance", f"{loss_db}dB")
    out = Path(f"limit-out{'.safetensors' if name == 'bake' else '.html'}")
    if name == "generate":
        camera = draw.choice(("arc:0.05", "arc:0.15", "orbit:0.02", "left:0.1", "spiral"))
        command = parse([name, str(source), "--camera", camera, *tolerance])
        promised = generation.promise(command)[1]
        error = generation_error(source, promised, camera)
    elif name == "render":
        promised = rendering.promise(parse([name, str(source), "--out", "x.webm", *tolerance]))
        error = scene_error(source, promised)
    elif name == "bake":
        promised = baking.promise(parse([name, str(source), "--out", str(out), *tolerance]))
        error = baked_error(source, promised)
    else:
        command = parse([*name.split(), str(source), "--out", str(out), *tolerance])
        promised = exporting.html_promise(source, command.limits)
        scene = load_scene(source)
        error = baking.frames_error(scene, exporting.reduced(scene, promised.choice.values))
    lost = loss_from_error(error)
    return Held(
        command=name,
        source=source.parent.name if source.stem == "scene" else source.stem,
        limit=f"{loss_db:g} dB",
        setting=words(promised),
        measured=f"{lost:.2g} dB",
        ratio=lost / loss_db,
    )


def generation_error(photo: Path, promised: Promise, camera: str) -> float:
    """Mean square difference of frames from those of the reference setting."""
    reference = {"side_share": 1.0, "color_matching_steps": generation.REFERENCE_STEPS}
    made = calibration_errors.generated_frames(photo, promised.choice.values, camera=camera)
    exact = calibration_errors.generated_frames(photo, reference, camera=camera)
    return calibration_errors.mean_error(made, exact)


def scene_error(file: Path, promised: Promise) -> float:
    """The same of a scene that is rendered."""
    return calibration_errors.render_error(load_scene(file), promised.choice.values)


def baked_error(file: Path, promised: Promise) -> float:
    """The same of key frames."""
    return calibration_errors.bake_error(load_scene(file), promised.choice.values["tolerance_px"])


def within_budget(name: str, source: Path, draw: random.Random) -> Held:
    """Choose by a budget, run, and read time and memory."""
    kept = Path(tempfile.gettempdir()) / "limit"
    out = kept if name == "generate" else kept.with_suffix(".webm")
    frames = str(draw.choice((5, 9, 17)))
    rest = (str(source), "--frames", frames, "--out", str(out))
    counter = generation if name == "generate" else rendering
    expected = Costing.of().forecast(name, counter.request_work(parse([name, *rest])))
    spare = draw.uniform(*SPARE)
    seconds, memory = expected.seconds * spare, expected.memory_bytes * max(spare / 2, 1.2)
    limit = f"{seconds:.1f}s,{memory / 1e9:.2f}GB"
    run = measure_process([name, *rest, "--budget", limit])
    said = next(line for line in run.text.splitlines() if line.startswith("within"))
    return Held(
        command=name,
        source=source.parent.name if source.stem == "scene" else source.stem,
        limit=limit,
        setting=said.split(": ")[1],
        measured=f"{run.seconds:.1f} s, {run.memory_bytes / 1e9:.2f} GB",
        ratio=max(run.seconds / seconds, run.memory_bytes / memory),
    )


def words(promised: Promise) -> str:
    """The setting in a cell of a table."""
    return ", ".join(f"{name} {value}" for name, value in promised.choice.values.items())


def requests(photos: list[Path], scenes: list[Path], seed: int) -> Iterator[Callable[[], Held]]:
    """Endless draws for each kind, until one of them is not refused."""
    draw = random.Random(seed)
    moving = [scene for scene in scenes if len(load_scene(scene).motion.moving_index)]
    sources = {"generate": photos, "bake": moving}
    for name, kind in KINDS:
        source = draw.choice(sources.get(name, scenes))
        loss_db, own = draw.choice(TOLERANCES_DB), random.Random(draw.random())
        if kind == "budget":
            yield lambda name=name, source=source, own=own: within_budget(name, source, own)
        else:
            yield lambda name=name, source=source, loss_db=loss_db, own=own: within_tolerance(
                name, source, loss_db, own
            )


def table(rows: list[Held], refused: list[str]) -> str:
    """Every request, and how many hold."""
    lines = ["| command | input | limit | setting | measured | measured / allowed |"]
    lines.append("|---|---|---|---|---|---:|")
    for row in rows:
        cells = (row.command, row.source, row.limit, row.setting, row.measured)
        lines.append(f"| {' | '.join(cells)} | {row.ratio:.2f} |")
    held = sum(row.ratio <= 1 for row in rows)
    near = sum(row.ratio <= MISS for row in rows)
    head = f"{held} of {len(rows)} hold; {near} are within {MISS} times; {len(refused)} refused."
    return "\n".join([head, "", *lines, "", *refused])


def main() -> None:
    """Make the inputs, run all requests, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--scenes", type=Path, nargs="*", help="in place of fresh ones")
    options = parser.parse_args()
    rows, refused = [], []
    with tempfile.TemporaryDirectory() as folder:
        photos = make_photos(Path(folder))
        scenes = options.scenes or make_scenes(Path(folder), photos)
        for request in requests(photos, scenes, options.seed):
            try:
                rows.append(request())
                print(rows[-1], flush=True)
            except ConfigError as error:
                refused.append(f"- {error}")
    print(table(rows, refused))
    if options.json:
        options.json.write_text(json.dumps([[row.command, row.limit, row.ratio] for row in rows]))


if __name__ == "__main__":
    main()
