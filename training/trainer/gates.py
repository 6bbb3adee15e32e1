"""Whether a stage was good enough for the next one, and the file that says how good it was."""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.io.require_file import is_file, read_text
from diff4splat.paths.formats.json_text import decode_object
from diff4splat.training.recipe.stage import Gate, StageRecipe
from diff4splat.training.trainer.logs.run_files import RESULT_FILE, finite

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,99}")
"""Of a checkpoint: a name inside its folder."""


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
    if not is_file(file) and not file.exists():
        raise ConfigError(
            f"{file}: expected the result of the stage before, got none; train that stage first"
        )
    try:
        return _stored(decode_object(read_text(file, "the result of a stage")))
    except FileFormatError as error:
        raise FileFormatError(
            f"{file}: expected the result of a stage, got something else; evaluate it again"
        ) from error


def _stored(found: dict[str, object]) -> StoredResult:
    wanted = {"stage": str, "finished": bool, "step": int, "checkpoint": str, "measures": dict}
    wrong = [key for key in {*wanted, *found} if type(found.get(key)) is not wanted.get(key)]
    if wrong:
        raise FileFormatError(f"expected {', '.join(wanted)}, got others at {min(wrong)[:60]}")
    name = str(found["checkpoint"])
    if not _NAME.fullmatch(name):
        raise FileFormatError(f"expected the name of a checkpoint, got {name[:60]!r}")
    numbers = [value for value in found["measures"].values() if value is not None]
    if not all(type(value) in (int, float) and abs(value) < math.inf for value in numbers):
        raise FileFormatError("expected measures that are numbers or null, got others")
    return StoredResult(**found)


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
