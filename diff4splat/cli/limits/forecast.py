"""``diff4splat forecast COMMAND ...``: time and memory of a command, before it runs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from diff4splat.cli.options.constraints import InputPath


@dataclass(frozen=True, kw_only=True)
class Forecasts:
    """Say how long a command would take and how much memory; nothing is loaded or written.

    The command follows with its options: `diff4splat forecast generate photo.jpg --frames 9`. A
    stage of training that was not measured here is counted, for 1, 8 and 32 GPUs.
    """

    command: Annotated[tuple[str, ...], tyro.conf.Positional]
    """generate, render, bake, export html, export onnx, fit or train, with its options."""
    calibration: Annotated[Path | None, InputPath(what="a calibration table", folder=False)] = None
    """Table of measured costs. Default: that of this machine, else the one that ships."""

    def run(self) -> None:
        """Count the work and print what it costs."""
        from diff4splat.cli.limits.command_work import command_work
        from diff4splat.cli.limits.costing import Costing
        from diff4splat.cli.limits.training import gpu_lines

        name, work = command_work(self.command)
        costing = Costing.of(self.calibration)
        if name == "train" and not costing.knows(name, work):
            print("\n".join(gpu_lines(self.command)))
            return
        costing.require_known(name, work)
        print(f"{name}: {costing.forecast(name, work)}")
        print(
            f"with {costing.cores:.2g} free cores; this machine takes {costing.speed:.2g} times "
            f"as long as that of the calibration ({costing.table.machine})"
        )


def forecasts(arguments: list[str]) -> Forecasts:
    """The forecast of the command line in ``arguments``; ``--calibration FILE`` may lead it."""
    if arguments[:1] == ["--calibration"]:
        return Forecasts(command=tuple(arguments[2:]), calibration=Path(*arguments[1:2]))
    return Forecasts(command=tuple(arguments))
