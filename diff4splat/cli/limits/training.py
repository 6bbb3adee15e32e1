"""Work of ``diff4splat train``: steps; each stage of a recipe has rates of its own."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise

if TYPE_CHECKING:
    from diff4splat.cli.train import Train
    from diff4splat.training.forecast.plan import StagePlanRow

NAME = "train"


def request_work(command: "Train") -> dict[str, float | int]:
    """Steps of this call, from the start of the stage."""
    recipe = command.recipe()
    steps = recipe.stage(command.stage).steps
    steps = steps if command.steps is None else min(steps, command.steps)
    stage = f"{recipe.name} {command.stage}"
    return {"start": 1, f"steps {stage}": steps, f"stage {stage}": 1}


def promise(command: "Train") -> Promise | None:
    """What the call is expected to need; None for stages that were not measured."""
    return Costing.of().plain_promise(NAME, request_work(command))


def gpu_lines(arguments: Sequence[str]) -> list[str]:
    """A table for GPUs, from counted operations.

    Raises:
        ConfigError: operations that are not counted.
    """
    from diff4splat.cli.common.parser import parse
    from diff4splat.training.forecast.hardware import H100
    from diff4splat.training.forecast.plan import GPUS, plan_stage

    command = parse(list(arguments))
    recipe = command.recipe()
    stage = recipe.stage(command.stage)
    rows = [plan_stage(recipe, stage, gpus) for gpus in GPUS]
    title = f"{recipe.name}, {stage.name}: {stage.steps:,} steps of {stage.global_batch} samples"
    head = ("GPUs", "GB each", "states", "gathered", "activations", "renders")
    head = (*head, "s/step", "days", "limited by")
    return [f"{title}; counted for {H100.name}", "  ".join(head), *map(_gpu_line, rows)]


def _gpu_line(row: "StagePlanRow") -> str:
    memory = row.memory
    values = (memory.total, memory.states, memory.gathered, memory.activations, memory.renders)
    widths = (7, 6, 8, 11, 7)
    columns = [f"{row.gpus:>4}"]
    columns += [f"{value / 1e9:>{width}.1f}" for value, width in zip(values, widths, strict=True)]
    if not row.fits:
        return "  ".join([*columns, "does not fit: more GPUs, or a smaller model"])
    return "  ".join([*columns, f"{row.seconds:>6.2f}", f"{row.days:>4.1f}", row.limit])
