"""Random requests with a tolerance or a budget: how many hold, and by how much the others miss.

Run ``python -m benchmarks.forecasts.limits FOLDER`` (needs scikit-image's photographs); prints
Markdown. A second call goes on where the first was stopped. Requests come from a seed. Inputs are
none of those that the calibration that ships was measured on.

    tolerance   frames of the chosen setting against those of the reference setting, as a loss in dB
    budget      a process of its own, its processor seconds and its peak memory

Seconds of a budget are by the clock, and the clock of a busy machine says as much of the others as
of the command. So the benchmark looks at processor seconds: the forecast is made for one free core
that this process has to itself, where both are the same. How slow a core is beside the others is
measured at the start of each command, as ever.

A request that the command refuses, as no setting holds it, is drawn again and counted.
"""

import argparse
import json
import os
import random
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import cv2
from skimage import data

from diff4splat.cli.calibration import calibration_errors, scene_errors
from diff4splat.cli.calibration.calibration_inputs import draw_photos
from diff4splat.cli.calibration.measured_process import measure_process
from diff4splat.cli.common.parser import parse
from diff4splat.cli.limits import baking, exporting, generation, rendering
from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.errors import Diff4SplatError
from diff4splat.io.scene_files.scene_file import load_scene
from diff4splat.outputs.budgets.costs import FREE_CORES
from diff4splat.outputs.budgets.limits import loss_from_error

PHOTOGRAPHS = ("camera", "brick", "coins", "grass", "moon", "clock")
WORLDS = ((101, 2), (103, 7))
SIDE_PX = 192
TOLERANCES_DB = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
KINDS = (
    *(("render", "tolerance"),) * 9,
    *(("bake", "tolerance"),) * 4,
    *(("export html", "tolerance"),) * 5,
    *(("generate", "budget"),) * 5,
    *(("render", "budget"),) * 5,
    *(("generate", "tolerance"),) * 12,
)
MOST_DRAWS = 20
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
    refused: tuple[str, ...] = ()
    """What was drawn before it."""


def make_photos(folder: Path) -> list[Path]:
    """Unseen photographs, small and grey ones in RGB, and unseen worlds."""
    files = [folder / f"world-{seed}-{index}.png" for seed, index in WORLDS]
    photos = files if all(file.exists() for file in files) else draw_photos(folder, WORLDS)
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
    prompt, size = "a block slides to the right", ("--resolution", str(SIDE_PX), "--frames", "9")
    fit = ("fit", str(capture), "--set", "coarse_steps=150")
    runs = [
        ("generate", str(photos[0]), *size, "--prompt", prompt),
        ("generate", str(photos[3]), *size),
        (*fit, "--steps", "250", "--budget", "4000"),
        (*fit, "--motion", "spacetime", "--steps", "200", "--budget", "3000"),
    ]
    if not capture.exists():
        measure_process(["prepare", "synth", *rig, "--seed", "5", "--out", str(capture)])
    for n, arguments in enumerate(runs):
        if not (folder / f"scene-{n}").exists():
            measure_process([*arguments, "--out", str(folder / f"scene-{n}")])
    return [folder / f"scene-{n}" / "scene.safetensors" for n in range(len(runs))]


def within_tolerance(name: str, source: Path, loss_db: float, draw: random.Random) -> Held:
    """Choose by a tolerance, and measure the loss."""
    promised, error = measured_error(name, source, ("--tolerance", f"{loss_db}dB"), draw)
    lost = loss_from_error(error)
    return Held(
        command=name,
        source=source_name(source),
        limit=f"{loss_db:g} dB",
        setting=words(promised),
        measured=f"{lost:.2g} dB",
        ratio=lost / loss_db,
    )


def measured_error(
    name: str, source: Path, limit: tuple[str, ...], draw: random.Random
) -> tuple[Promise, float]:
    """What a command chooses, and the error of that against its reference setting."""
    if name == "generate":
        camera = draw.choice(("arc:0.05", "arc:0.15", "orbit:0.02", "left:0.1", "spiral"))
        command = parse([name, str(source), "--camera", camera, *limit])
        promised, side_px = generation.promise(command)[1], generation.image_side(command)[0]
        values = promised.choice.values
        made = calibration_errors.generated_frames(
            source, values, side_px=side_px, cameras=(camera,)
        )
        exact = exact_generation(source, side_px, camera)
        return promised, scene_errors.mean_error(made[0], exact)
    if name == "render":
        promised = rendering.promise(parse([name, str(source), "--out", "x.webm", *limit]))
        exact = exact_views(source)
        return promised, exact.error(load_scene(source), promised.choice.values)
    scene = load_scene(source)
    if name == "bake":
        promised = baking.promise(parse([name, str(source), "--out", "x.safetensors", *limit]))
        made = scene_errors.baked(scene, promised.choice.values["tolerance_px"])
    else:
        command = parse([*name.split(), str(source), "--out", "x.html", *limit])
        promised = exporting.html_promise(source, command.limits)
        made = exporting.reduced(scene, promised.choice.values)
    return promised, scene_errors.mean_error(baking.path_frames(made), exact_path(source))


@cache
def exact_generation(photo: Path, side_px: int, camera: str) -> Sequence:
    """Frames of the reference setting of ``generate``."""
    reference = {"side_share": 1.0, "color_matching_steps": generation.REFERENCE_STEPS}
    found = calibration_errors.generated_frames(
        photo, reference, side_px=side_px, cameras=(camera,)
    )
    return found[0]


@cache
def exact_views(file: Path) -> scene_errors.ViewFrames:
    """Frames of the reference setting of ``render``."""
    return scene_errors.ViewFrames.exact(load_scene(file))


@cache
def exact_path(file: Path) -> list:
    """Frames of the scene as it is."""
    return baking.path_frames(load_scene(file))


def within_budget(name: str, source: Path, draw: random.Random) -> Held:
    """Choose by a budget, run, and read time and memory."""
    folder = source.parent if name == "generate" else source.parent.parent
    out = folder / ("limit" if name == "generate" else "limit.webm")
    frames = str(draw.choice((5, 9, 17)))
    camera = ("--camera", "arc:0.1") if name == "render" else ()
    rest = (str(source), "--frames", frames, *camera, "--out", str(out))
    counter = generation if name == "generate" else rendering
    expected = Costing.of().forecast(name, counter.request_work(parse([name, *rest])))
    spare = draw.uniform(*SPARE)
    seconds, memory = expected.seconds * spare, expected.memory_bytes * max(spare / 2, 1.2)
    limit = f"{seconds:.1f}s,{memory / 1e9:.2f}GB"
    run = measure_process([name, *rest, "--budget", limit])
    said = next(line for line in run.text.splitlines() if line.startswith("within"))
    return Held(
        command=name,
        source=source_name(source),
        limit=limit,
        setting=said.split(": ")[1],
        measured=f"{run.cpu_seconds:.1f} s, {run.memory_bytes / 1e9:.2f} GB",
        ratio=max(run.cpu_seconds / seconds, run.memory_bytes / memory),
    )


def words(promised: Promise) -> str:
    """The setting in a cell of a table."""
    return ", ".join(f"{name} {value}" for name, value in promised.choice.values.items())


def source_name(source: Path) -> str:
    """A photo's name, or the folder of a scene."""
    return source.parent.name if source.stem == "scene" else source.stem


def request(number: int, sources: dict[str, list[Path]], seed: int) -> Held:
    """One request of its kind; what is refused is drawn again."""
    name, kind = KINDS[number]
    draw, refused = random.Random(f"{seed} {number}"), []
    for _ in range(MOST_DRAWS):
        source, loss_db = draw.choice(sources[name]), draw.choice(TOLERANCES_DB)
        try:
            if kind == "budget":
                held = within_budget(name, source, draw)
            else:
                held = within_tolerance(name, source, loss_db, draw)
            return replace(held, refused=tuple(refused))
        except Diff4SplatError as error:
            refused.append(str(error))
    raise RuntimeError(f"request {number}: expected one that holds, got {refused[-1]}")


def table(rows: list[Held]) -> str:
    """Every request, and how many hold."""
    lines = ["| command | input | limit | setting | measured | measured / allowed |"]
    lines.append("|---|---|---|---|---|---:|")
    for row in rows:
        cells = (row.command, row.source, row.limit, row.setting, row.measured)
        lines.append(f"| {' | '.join(cells)} | {row.ratio:.2f} |")
    held = sum(row.ratio <= 1 for row in rows)
    near = sum(row.ratio <= MISS for row in rows)
    refused = sum(len(row.refused) for row in rows)
    head = f"{held} of {len(rows)} hold; {near} are within {MISS} times; {refused} were refused."
    return "\n".join([head, "", *lines])


def once(file: Path, make: Callable[[], Held]) -> Held:
    """The result in a file, or a new one."""
    if not file.exists():
        file.write_text(json.dumps(asdict(make())))
    return Held(**json.loads(file.read_text()))


def main() -> None:
    """Make the inputs, run all requests, print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of inputs and results; an earlier call goes on")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    os.environ[FREE_CORES] = "1"
    photos = make_photos(options.folder)
    scenes = make_scenes(options.folder, photos)
    moving = [scene for scene in scenes if len(load_scene(scene).motion.moving_index)]
    sources = {"generate": photos, "render": scenes, "export html": scenes, "bake": moving}
    rows = []
    for number in range(len(KINDS)):
        file = options.folder / f"request-{options.seed}-{number}.json"
        rows.append(once(file, lambda number=number: request(number, sources, options.seed)))
        print(number, rows[-1], flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
