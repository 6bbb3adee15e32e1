"""Whether a stage was good enough for the next one, and the file that says how good it was."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.training.recipe.stage import Gate, StageRecipe
from diff4splat.training.trainer.logs.run_files import RESULT_FILE, finite


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredResult:
    """``result.json`` of a stage."""

    stage: str
    finished: bool
    step: int
    checkpoint: str
    measures: Mapping[str, float | None]


def write_result(folder: Path, result: StoredResult) -> None:
    """Write it whole or not at all."""
    values = {
        "stage": result.stage,
        "finished": result.finished,
        "step": result.step,
        "checkpoint": result.checkpoint,
        "measures": finite(result.measures),
    }
    write_text(folder / RESULT_FILE, json.dumps(values, indent=2) + "\n")


def read_result(folder: Path) -> StoredResult:
    """What a stage reached.

    Raises:
        ConfigError: the stage was never begun there.
        FileFormatError: the file is damaged.
    """
    file = folder / RESULT_FILE
    if not file.is_file():
        raise ConfigError(
            f"{file}: expected the result of the stage before, got none; train that stage first"
        )
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(found["measures"], dict):
            raise TypeError
        return StoredResult(**found)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise FileFormatError(
            f"{file}: expected the result of a stage, got something else; evaluate it again"
        ) from error


def stage_may_start(previous: StageRecipe, folder: Path, override: bool = False) -> None:
    """Refuse to go on from a stage that is not over or fell short.

    With ``override`` it is enough that the stage was begun.

    Raises:
        ConfigError: which measure fell short, and by how much.
    """
    result = read_result(folder)
    if override:
        return
    way_out = f"train {previous.name} longer, or override with --ignore-gates"
    if not result.finished:
        raise ConfigError(
            f"stage {previous.name}: expected {previous.steps} steps before the next stage, got "
            f"{result.step}; {way_out}"
        )
    short = [text for gate in previous.gates if (text := _shortfall(gate, result.measures))]
    if short:
        raise ConfigError(f"stage {previous.name}: {'; '.join(short)}; {way_out}")


def _shortfall(gate: Gate, measures: Mapping[str, float | None]) -> str | None:
    wanted = f"expected {gate.measure} {gate.direction.replace('_', ' ')} {gate.bound:g}"
    reached = measures.get(gate.measure)
    if reached is None:
        known = ", ".join(name for name, value in measures.items() if value is not None)
        return f"{wanted}, got no such finite measure (there are: {known or 'none'})"
    short = gate.bound - reached if gate.direction == "at_least" else reached - gate.bound
    return f"{wanted}, got {reached:g}, {short:.3g} short" if short > 0 else None
