"""Runs that a calibration measures, each in a process of its own, and the rates they give."""

from collections.abc import Callable, Iterable
from pathlib import Path

from diff4splat.cli.calibration.calibration_inputs import CAPTURE, PROMPT
from diff4splat.cli.calibration.measured_process import measure_process
from diff4splat.cli.limits.command_work import command_work
from diff4splat.outputs.budgets.costs import CostRates
from diff4splat.outputs.budgets.rates_fit import fit_rates

Run = list[str]
GENERATE = (
    ("128", "3"),
    ("128", "49", "--skip-depth"),
    ("256", "5", "--infill", "none"),
    ("256", "33"),
    ("256", "5", "--prompt", PROMPT),
    ("384", "3", "--color-matching-steps", "20"),
    ("512", "17"),
    ("512", "3", "--infill", "none", "--skip-depth"),
)
VIDEO_FILL = (("256", "3", "--fill", "video", "--steps", "2"), ("256", "3", "--fill", "video"))
FITS = (("1", "150", "1000"), ("1", "300", "4000"))
TRAIN_STAGES = (("test", "vae"), ("test", "static-low"), ("test", "video_diffusion"))
TRAIN_STEPS = ("4", "16")


MEMORY_AMOUNTS = frozenset(
    ("start", "gaussians", "packed_gaussians", "depth_pixels", "prompted", "video_fill", "budget")
)
"""What is held at once; frames are written as they come, and steps leave nothing behind."""


def generation_runs(photo: Path, folder: Path) -> list[Run]:
    """Sizes, lengths and options of ``generate``."""
    return [
        [
            *("generate", str(photo), "--camera", "arc:0.1", "--out", str(folder / f"scene-{n}")),
            *("--resolution", side, "--frames", frames, *rest),
        ]
        for n, (side, frames, *rest) in enumerate((*GENERATE, *VIDEO_FILL))
    ]


def scene_runs(folder: Path) -> list[Run]:
    """Commands that read what the generations and fits wrote."""
    moving, large = (folder / f"scene-{n}" / "scene.safetensors" for n in (4, 6))
    field = folder / "fit-hexplane-1" / "scene.safetensors"
    runs = []
    for n, scene in enumerate((moving, large, field)):
        still, short = str(folder / f"view-{n}.png"), str(folder / f"view-{n}.webm")
        runs.append(["render", str(scene), "--out", still])
        runs.append(["render", str(scene), "--out", short])
        runs.append(["export", "html", str(scene), "--out", str(folder / f"page-{n}.html")])
    longer = ("--camera", "orbit:0.05", "--frames", "60", "--resolution", "384")
    runs.append(["render", str(field), *longer, "--out", str(folder / "long.webm")])
    runs.append(["render", str(large), *longer, "--out", str(folder / "long-large.webm")])
    for n, (scene, px) in enumerate(
        ((field, "0.05"), (field, "0.2"), (field, "1"), (moving, "0.1"))
    ):
        baked = str(folder / f"baked-{n}.safetensors")
        runs.append(["bake", str(scene), "--tolerance-px", px, "--out", baked])
    return runs


def fit_runs(folder: Path) -> list[Run]:
    """Short fits with each motion; the capture is drawn first."""
    return [
        [
            *("fit", str(folder / "capture"), "--motion", motion, "--budget", budget),
            *("--steps", steps, "--set", f"coarse_steps={100 * int(coarse)}"),
            *("--out", str(folder / f"fit-{motion}-{n}")),
        ]
        for motion in ("hexplane", "spacetime", "static")
        for n, (coarse, steps, budget) in enumerate(FITS)
    ]


def train_runs(folder: Path) -> list[Run]:
    """A few steps of stages of the small recipe."""
    return [
        [
            *("train", "--config", recipe, "--stage", stage, "--steps", steps),
            *("--ignore-gates", "--out", str(folder / f"train-{recipe}-{stage}-{steps}")),
        ]
        for recipe, stage in TRAIN_STAGES
        for steps in TRAIN_STEPS
    ]


def draw_capture(folder: Path) -> Run:
    """The command that draws the clip which fits learn from."""
    return ["prepare", "synth", *CAPTURE, "--out", str(folder / "capture")]


def measure_rates(runs: Iterable[Run], advance: Callable[[], None]) -> dict[str, CostRates]:
    """Rates of every command among ``runs``, which run in order."""
    seen: dict[str, list[tuple[dict[str, float], float, float]]] = {}
    for arguments in runs:
        name, work = command_work(arguments)
        measured = measure_process(arguments)
        seen.setdefault(name, []).append((work, measured.cpu_seconds, measured.memory_bytes))
        advance()
    return {name: rates(measured) for name, measured in seen.items()}


def rates(measured: list[tuple[dict[str, float], float, float]]) -> CostRates:
    """Rates of time and memory from (work, processor seconds, bytes) of several runs."""
    work = [one for one, _, _ in measured]
    kept = [{name: one[name] for name in MEMORY_AMOUNTS & one.keys()} for one in work]
    return CostRates(
        seconds=fit_rates(work, [seconds for _, seconds, _ in measured]),
        memory_bytes=fit_rates(kept, [memory for _, _, memory in measured]),
    )
