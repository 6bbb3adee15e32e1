"""The settings of a pipeline: one TOML file, read strictly.

Tables: ``[import]``, and as wanted ``[align]``, ``[captions]``, ``[score]``, ``[executor]`` and
``[executor.sbatch]``. Paths are relative to the file.
"""

import tomllib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from diff4splat.errors import ConfigError
from diff4splat.io.require_file import read_bytes

_VERSION, _MOST_BYTES = 1, 1 << 20
ExecutorKind = Literal["local", "slurm", "ray"]
ReferenceName = Literal["depth", "tracks", "stereo", "triangulation", "megasam"]
Method = Literal["disparity", "paper_depth_space", "least_squares"]
DepthCoding = Literal["pxr24", "half", "half_plain", "float"]
"""As where they are used: settings are read before torch is loaded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportTable:
    """``[import]``: options of ``prepare import``."""

    path: Path
    dataset: str
    frames: int = 81
    step: int | None = None
    max_side: int | None = 512
    tracks: int = 2048
    views: int = 4
    sequences: int | None = None
    images: Literal["png", "jpeg", "mp4"] = "png"
    depth: DepthCoding = "pxr24"


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignTable:
    """``[align]``: options of ``prepare align``."""

    reference: ReferenceName
    disparity: Path | None = None
    megasam: Path | None = None
    normaliser: float | None = None
    method: Method = "disparity"


@dataclass(frozen=True, slots=True, kw_only=True)
class CaptionTable:
    """``[captions]``: options of ``prepare captions``."""

    captions: Path | None = None
    captioner: str = ""
    replace: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreTable:
    """``[score]``: options of the scores of ``prepare curate``."""

    quality: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExecutorTable:
    """``[executor]``: where tasks run. Each takes one core unless ``cpus_per_task`` says more."""

    kind: ExecutorKind = "local"
    workers: int = 1
    """Tasks at a time; -1 is any number."""
    cpus_per_task: int = 1
    memory_gb_per_cpu: int = 4
    time: str = "24:00:00"
    """Slurm's limit for one task."""
    partition: str = ""
    qos: str = "normal"
    environment: str = ""
    """Command that activates the Python environment on a machine of the cluster."""
    sbatch: dict[str, Any] = field(default_factory=dict)
    """More options of sbatch."""

    def __post_init__(self) -> None:
        if self.workers != -1 and self.workers < 1:
            raise ConfigError(f"executor, workers: expected 1 or more, or -1, got {self.workers}")
        if self.kind == "slurm" and not self.partition:
            raise ConfigError("executor, partition: expected a partition of Slurm, got none")


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineSettings:
    """Everything that a task needs to know."""

    out: Path
    tasks: int
    source: ImportTable
    align: AlignTable | None = None
    captions: CaptionTable | None = None
    score: ScoreTable = field(default_factory=ScoreTable)
    executor: ExecutorTable = field(default_factory=ExecutorTable)

    def __post_init__(self) -> None:
        if not 1 <= self.tasks <= 1_000_000:
            raise ConfigError(f"tasks: expected 1 to 1000000, got {self.tasks}")


_TABLES = {
    "import": ImportTable,
    "align": AlignTable,
    "captions": CaptionTable,
    "score": ScoreTable,
    "executor": ExecutorTable,
}


def read_settings(file: Path) -> PipelineSettings:
    """The settings of ``file``.

    Raises:
        ConfigError: not TOML, an unknown key or a value of another kind; says which.
        InputError, FileFormatError: no such file, or a huge one.
    """
    try:
        text = read_bytes(file, "settings of a pipeline", max_bytes=_MOST_BYTES).decode()
        return _settings(tomllib.loads(text), file.resolve().parent)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{file}: expected TOML, got '{error}'") from error
    except ConfigError as error:
        raise ConfigError(f"{file}: {error}") from error


def _settings(document: dict[str, Any], folder: Path) -> PipelineSettings:
    _known(document, {"version", "out", "tasks", *_TABLES}, "keys")
    if document.get("version") != _VERSION:
        raise ConfigError(f"version: expected {_VERSION}, got {document.get('version')!r:.60}")
    if "import" not in document:
        raise ConfigError("expected a table [import], got none")
    tables = {
        name: _table(kind, document[name], name, folder)
        for name, kind in _TABLES.items()
        if name in document
    }
    source = tables.pop("import")
    return PipelineSettings(
        out=_value(Path, document.get("out"), "out", folder),
        tasks=_value(int, document.get("tasks"), "tasks", folder),
        source=source,
        **tables,
    )


def _table(kind: type, given: Any, name: str, folder: Path) -> Any:
    if not isinstance(given, dict):
        raise ConfigError(f"{name}: expected a table, got {given!r:.60}")
    hints = get_type_hints(kind)
    _known(given, {each.name for each in fields(kind)}, f"keys of {name}")
    values = {
        key: _value(hints[key], value, f"{name}, {key}", folder) for key, value in given.items()
    }
    try:
        return kind(**values)
    except TypeError as error:  # what has no default was not given
        raise ConfigError(f"{name}: expected more keys, got '{error}'") from error


def _value(hint: Any, value: Any, where: str, folder: Path) -> Any:
    """``value`` as what ``hint`` says; paths become absolute."""
    kinds = [kind for kind in get_args(hint) or (hint,) if kind is not type(None)]
    if get_origin(hint) is Literal:
        if value not in kinds:
            raise ConfigError(f"{where}: expected one of {', '.join(kinds)}, got {value!r:.60}")
        return value
    if Path in kinds and isinstance(value, str) and value:
        return folder / value
    if float in kinds and type(value) is int:
        return float(value)
    if get_origin(hint) is dict and isinstance(value, dict):
        return value
    if type(value) not in kinds:
        names = " or ".join(getattr(kind, "__name__", str(kind)) for kind in kinds)
        raise ConfigError(f"{where}: expected {names}, got {value!r:.60}")
    return value


def _known(table: dict[str, Any], known: set[str], what: str) -> None:
    odd = sorted(set(table) - known)
    if odd:
        raise ConfigError(
            f"{what}: expected some of {', '.join(sorted(known))}, got {odd[0]!r:.60}"
        )
