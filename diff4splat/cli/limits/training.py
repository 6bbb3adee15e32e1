"""Work of ``diff4splat train``: steps; each stage of a recipe has rates of its own."""

from typing import TYPE_CHECKING

from diff4splat.cli.limits.costing import Costing, Promise

if TYPE_CHECKING:
    from diff4splat.cli.train import Train

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
