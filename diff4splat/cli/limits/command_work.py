"""The work of any command that has a forecast, counted before anything is loaded."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from diff4splat.errors import ConfigError

if TYPE_CHECKING:
    from diff4splat.cli.fit import Fit
    from diff4splat.cli.train import Train

COMMANDS = ("generate", "render", "bake", "export html", "fit", "train")


def command_work(arguments: Sequence[str]) -> tuple[str, dict[str, float]]:
    """(name in the calibration table, counted work) of a command line.

    Raises:
        ConfigError: a command without a forecast.
        Diff4SplatError: its arguments cannot be used.
    """
    from diff4splat.cli.common.parser import parse
    from diff4splat.cli.options.constraints import check_arguments

    words = [name.split() for name in COMMANDS]
    names = [" ".join(one) for one in words if list(arguments[: len(one)]) == one]
    if not names:
        got = " ".join(arguments[:2]) or "none"
        raise ConfigError(f"forecast: expected one of {', '.join(COMMANDS)}, got {got}")
    command = parse(list(arguments))
    check_arguments(command)
    return names[0], counted(names[0], command)


def counted(name: str, command) -> dict[str, float | int]:
    """The work of a parsed command."""
    from diff4splat.cli.limits import baking, exporting, generation, rendering
    from diff4splat.cli.scenes.export_html import scene_source

    counters = {
        "generate": generation.request_work,
        "render": rendering.request_work,
        "bake": baking.request_work,
        "export html": lambda one: exporting.html_work(scene_source(one.scene)),
        "fit": fit_work,
        "train": train_work,
    }
    return counters[name](command)


def fit_work(command: "Fit") -> dict[str, float | int]:
    """Steps, Gaussians and pixels of a fit; the headers of the images are read."""
    settings, capture = command.settings(), command.capture()
    height, width = capture.cameras.size_px
    steps = settings.coarse_steps + settings.fine_steps
    return {
        "start": 1,
        f"fitted_gaussians {command.motion}": settings.density.budget * settings.fine_steps,
        f"fit_steps {command.motion}": settings.fine_steps,
        "fitted_pixels": height * width * steps,
        "captured_pixels": height * width * len(capture),
        "budget": settings.density.budget,
    }


def train_work(command: "Train") -> dict[str, float | int]:
    """Steps of a stage; each stage of a recipe has its own rate."""
    recipe = command.recipe()
    steps = recipe.stage(command.stage).steps
    steps = steps if command.steps is None else min(steps, command.steps)
    stage = f"{recipe.name} {command.stage}"
    return {"start": 1, f"steps {stage}": steps, f"stage {stage}": 1}
