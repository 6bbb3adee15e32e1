"""Runs that a calibration measures, each in a process of its own, and the rates they give.

Processor seconds are divided by how slow the machine was just then (``measure_speed_s``), so that a
run beside others counts like one alone.
"""

import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from diff4splat.cli.calibration.calibration_inputs import CAPTURES, PROMPT
from diff4splat.cli.calibration.calibration_record import CalibrationRecord
from diff4splat.cli.calibration.measured_process import measure_process
from diff4splat.cli.limits.command_work import command_work
from diff4splat.outputs.budgets.costs import KNOWN_BYTES, CostRates, Work, other_load
from diff4splat.outputs.budgets.rates_fit import fit_rates
from diff4splat.outputs.budgets.speed import measure_speed_s

Run = list[str]
GENERATE = (
    ("128", "3"),
    ("128", "49", "--skip-depth"),
    ("256", "5", "--infill", "none"),
    ("256", "25"),
    ("256", "5", "--prompt", PROMPT),
    ("320", "3", "--color-matching-steps", "20"),
    ("384", "5"),
    ("512", "3", "--infill", "none", "--skip-depth"),
    ("192", "3", "--fill", "video", "--steps", "2"),
    ("192", "3", "--fill", "video"),
)
STATIC, PROMPTED, LARGE = 3, 4, 6
"""Places among ``GENERATE`` of scenes that other runs read."""
FITS = (
    ("capture", "hexplane", "1500", "100", "100", ()),
    ("capture", "hexplane", "6000", "100", "200", ("--set", "stillness.min_score=0")),
    ("capture", "spacetime", "1500", "50", "60", ()),
    ("capture", "spacetime", "6000", "100", "200", ("--set", "stillness.min_score=0")),
    ("capture", "static", "1500", "50", "50", ()),
    ("capture", "static", "12000", "50", "150", ()),
    ("capture", "hexplane", "1500", "50", "300", ()),
    ("capture", "spacetime", "1500", "50", "250", ()),
    ("large-capture", "static", "1500", "50", "100", ()),
    ("large-capture", "hexplane", "24000", "50", "150", ()),
    ("large-capture", "spacetime", "24000", "50", "150", ()),
)
"""(capture, motion, budget, coarse steps, fine steps, options); without a smallest score all may
move. Of each motion at least three: steps, Gaussians and moving ones have rates of their own. Two
have as many Gaussians as a fit starts with by default: many need more than one thread."""
FIELD, NATIVE, SPARSE = 1, 3, 6
"""The same among ``FITS``; in the last one few Gaussians move."""
ONNX = (("--shapes-only",), ())
SAME_START = frozenset({"bake", "export html"})
"""Both load the same code and read a scene; a renderer for frames starts threads besides."""
TRAIN_STAGES = (("test", "vae"), ("test", "static-low"), ("test", "video_diffusion"))
TRAIN_STEPS = ("4", "16")
MEMORY_AMOUNTS = frozenset(
    (
        *("start", "gaussians", "packed_gaussians", "depth_pixels", "prompted", "video_fill"),
        *("held_gaussians", "held_keys", "moved_gaussians", "stored_weights"),
    )
)
"""What is held at once; other frames are written as they come, and steps leave nothing behind."""
NO_TIME = KNOWN_BYTES | {"held_gaussians"}
"""A step works on every Gaussian, so their time is that of ``fitted_gaussians``. Fits of few steps
cannot tell rates of both apart."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Costs:
    """What all runs say together."""

    rates: dict[str, CostRates]
    speed_s: float
    load: float


def generation_runs(photo: Path, folder: Path) -> list[Run]:
    """Sizes, lengths and options of ``generate``."""
    return [
        [
            *("generate", str(photo), "--camera", "arc:0.1", "--out", str(folder / f"scene-{n}")),
            *("--resolution", side, "--frames", frames, *rest),
        ]
        for n, (side, frames, *rest) in enumerate(GENERATE)
    ]


def scene_runs(folder: Path, wide: Path) -> list[Run]:
    """Commands that read what the generations and fits wrote; in ``wide`` everything moves."""
    static, moving, large = (scene_file(folder, "scene", n) for n in (STATIC, PROMPTED, LARGE))
    field, native, sparse = (scene_file(folder, "fit", n) for n in (FIELD, NATIVE, SPARSE))
    runs = [["render", str(large), "--out", str(folder / "view.png")]]
    for n, scene in enumerate((static, moving, wide, native)):
        runs.append(["render", str(scene), "--out", str(folder / f"view-{n}.webm")])
    for n, scene in enumerate((static, moving, wide)):
        runs.append(["export", "html", str(scene), "--out", str(folder / f"page-{n}.html")])
    longer = ("--camera", "orbit:0.05", "--frames", "40", "--resolution", "320")
    runs.append(["render", str(field), *longer, "--out", str(folder / "long.webm")])
    baked = ((field, "0.1"), (sparse, "0.1"), (wide, "1"), (wide, "0.1"))
    baked += ((moving, "0.1"), (native, "0.1"))
    for n, (scene, px) in enumerate(baked):
        out = str(folder / f"baked-{n}.safetensors")
        runs.append(["bake", str(scene), "--tolerance-px", px, "--out", out])
    return runs


def scene_file(folder: Path, kind: str, number: int) -> Path:
    """Of a generation (``scene``) or a fit, by its place in the list."""
    return folder / f"{kind}-{number}" / "scene.safetensors"


def fit_runs(folder: Path) -> list[Run]:
    """Short fits with each motion; captures are drawn first."""
    return [
        [
            *("fit", str(folder / capture), "--motion", motion, "--budget", budget),
            *("--steps", fine, "--set", f"coarse_steps={coarse}", *rest),
            *("--out", str(folder / f"fit-{n}")),
        ]
        for n, (capture, motion, budget, coarse, fine, rest) in enumerate(FITS)
    ]


def onnx_runs(folder: Path) -> list[Run]:
    """Exports of the smallest model, with less and less left out."""
    return [
        ["export", "onnx", "--model", "test", *rest, "--out", str(folder / f"graphs-{n}")]
        for n, rest in enumerate(ONNX)
    ]


def train_runs(folder: Path) -> list[Run]:
    """A few steps of stages of the small recipe, one after another in a folder."""
    return [
        [
            *("train", "--config", recipe, "--stage", stage, "--steps", steps),
            *("--ignore-gates", "--out", str(folder / f"train-{recipe}-{steps}")),
        ]
        for recipe, stage in TRAIN_STAGES
        for steps in TRAIN_STEPS
    ]


def warm_up_runs(photo: Path, folder: Path) -> list[Run]:
    """The shortest generation and fits, so that nothing that is measured compiles."""
    size = ("--resolution", "128", "--frames", "3", "--prompt", PROMPT)
    fit = ("fit", str(folder / "capture"), "--budget", "500", "--steps", "5")
    return [
        ["generate", str(photo), *size, "--out", str(folder / "warm")],
        [*fit, "--set", "coarse_steps=5", "--out", str(folder / "warm-fit")],
    ]


def draw_captures(folder: Path) -> list[Run]:
    """The commands that draw the clips which fits learn from."""
    return [
        ["prepare", "synth", *options, "--out", str(folder / name)]
        for name, options in CAPTURES.items()
    ]


def measure_costs(
    runs: Sequence[Run], record: CalibrationRecord, advance: Callable[[], None]
) -> Costs:
    """Rates of every command among ``runs``, which run in order."""
    seen = []
    for arguments in runs:
        seen.append(record.once(" ".join(arguments), lambda run=arguments: _measure(run)))
        advance()
    speed_s = statistics.median(one["speed_s"] for one in seen)
    by_name: dict[str, list[tuple[Work, float, float]]] = {}
    for arguments, one in zip(runs, seen, strict=True):
        name, work = command_work(arguments)
        seconds = one["cpu_seconds"] * speed_s / one["speed_s"]
        by_name.setdefault(name, []).append((work, seconds, one["memory_bytes"]))
    return Costs(
        rates=rates_together(by_name),
        speed_s=speed_s,
        load=statistics.fmean(one["load"] for one in seen),
    )


def _measure(arguments: Run) -> dict[str, float]:
    before_s, load = measure_speed_s(), other_load()
    measured = measure_process(arguments)
    return {
        "cpu_seconds": measured.cpu_seconds,
        "memory_bytes": measured.memory_bytes,
        "speed_s": (before_s * measure_speed_s()) ** 0.5,
        "load": load,
    }


def rates_together(
    measured: Mapping[str, Sequence[tuple[Work, float, float]]],
) -> dict[str, CostRates]:
    """Rates of several commands; ``SAME_START`` share that of the start."""
    apart = {name: rates(runs) for name, runs in measured.items() if name not in SAME_START}
    joint = [
        ({_own(name, amount): value for amount, value in work.items()}, seconds, memory)
        for name in SAME_START
        for work, seconds, memory in measured.get(name, ())
    ]
    seconds = rates(joint).seconds if joint else {}
    for name in SAME_START & measured.keys():
        amounts = {amount for work, _, _ in measured[name] for amount in work}
        owned = {amount: seconds.get(_own(name, amount)) for amount in amounts}
        kept = {amount: rate for amount, rate in owned.items() if rate is not None}
        apart[name] = CostRates(seconds=kept, memory_bytes=rates(measured[name]).memory_bytes)
    return {name: apart[name] for name in measured}


def _own(command: str, amount: str) -> str:
    return amount if amount == "start" else f"{command}: {amount}"


def rates(measured: Sequence[tuple[Work, float, float]]) -> CostRates:
    """Rates of time and memory from (work, processor seconds, bytes) of several runs."""
    work = [one for one, _, _ in measured]
    timed = [{name: one[name] for name in one.keys() - NO_TIME} for one in work]
    held = [{name: one[name] for name in MEMORY_AMOUNTS & one.keys()} for one in work]
    known = [sum(one.get(name, 0.0) for name in KNOWN_BYTES) for one in work]
    memory = [peak - part for (_, _, peak), part in zip(measured, known, strict=True)]
    return CostRates(
        seconds=fit_rates(timed, [seconds for _, seconds, _ in measured]),
        memory_bytes=fit_rates(held, memory),
    )
