"""The work of any command that has a forecast, counted before anything is loaded."""

from collections.abc import Sequence

from diff4splat.errors import ConfigError

COMMANDS = ("generate", "render", "bake", "export html", "export onnx", "fit", "train")


def command_work(arguments: Sequence[str]) -> tuple[str, dict[str, float | int]]:
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
    from diff4splat.cli.limits import (
        baking,
        exporting,
        fitting,
        generation,
        rendering,
        tracing,
        training,
    )
    from diff4splat.cli.scenes.export_html import scene_source

    counters = {
        "generate": generation.request_work,
        "render": rendering.request_work,
        "bake": baking.request_work,
        "export html": lambda one: exporting.html_work(scene_source(one.scene)),
        "export onnx": tracing.request_work,
        "fit": fitting.request_work,
        "train": training.request_work,
    }
    return counters[name](command)
