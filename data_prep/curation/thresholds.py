"""The one file of thresholds: reading and checking it."""

import tomllib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, Literal, get_args

from diff4splat.data_prep.curation.scoring import STAGES
from diff4splat.errors import ConfigError
from diff4splat.io.require_file import read_bytes

FILE_NAME = "thresholds.toml"
_VERSION, _MOST_BYTES = 1, 1 << 20
AppliesTo = Literal["all", "real", "rendered", "static", "dynamic"]
QuotaKind = Literal["dataset", "motion", "path"]
_GATE_KEYS = {"stage", "score", "reason", "least", "most", "applies_to", "required"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """Which values of a score pass."""

    stage: str
    score: str
    reason: str
    least: float | None = None
    most: float | None = None
    applies_to: AppliesTo = "all"
    required: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """Everything that decides which clips are selected."""

    gates: tuple[Gate, ...]
    hash_bits: int = 3
    cosine: float = 0.97
    """Of features from which clips are duplicates; above 1 is never."""
    per_group: int = 0
    quotas: dict[str, dict[str, int]] = field(default_factory=dict)
    text: str = ""
    """As in the file, to be stored beside the decisions."""


def default_thresholds() -> str:
    """The text of the file that is used unless another is given."""
    source = resources.files("diff4splat.data_prep.curation") / FILE_NAME
    return source.read_text(encoding="utf-8")


def read_thresholds(file: Path | None) -> Thresholds:
    """The thresholds of ``file``; None is the default.

    Raises:
        ConfigError: not TOML, an unknown key, stage or value; says which.
    """
    name = FILE_NAME if file is None else str(file)
    try:
        if file is None:
            text = default_thresholds()
        else:
            text = read_bytes(file, "thresholds", max_bytes=_MOST_BYTES).decode()
        document = tomllib.loads(text)
        return _thresholds(document, text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name}: expected TOML, got '{error}'") from error
    except ConfigError as error:
        raise ConfigError(f"{name}: {error}") from error


def _thresholds(document: dict[str, Any], text: str) -> Thresholds:
    _known(document, {"version", "gate", "duplicates", "quotas"}, "keys")
    if document.get("version") != _VERSION:
        raise ConfigError(f"version: expected {_VERSION}, got {document.get('version')!r}")
    duplicates = _table(document, "duplicates")
    _known(duplicates, {"hash_bits", "cosine", "per_group"}, "keys of duplicates")
    gates = document.get("gate", [])
    if not isinstance(gates, list) or not all(isinstance(each, dict) for each in gates):
        raise ConfigError("gate: expected tables [[gate]], got something else")
    quotas = _table(document, "quotas")
    _known(quotas, set(get_args(QuotaKind)), "quotas")
    return Thresholds(
        gates=tuple(_gate(each, number) for number, each in enumerate(gates, 1)),
        hash_bits=_count(duplicates.get("hash_bits", 3), "hash_bits"),
        cosine=_number(duplicates.get("cosine", 0.97), "cosine"),
        per_group=_count(duplicates.get("per_group", 0), "per_group"),
        quotas={kind: _quota(quotas, kind) for kind in quotas},
        text=text,
    )


def _gate(table: dict[str, Any], number: int) -> Gate:
    where = f"gate {number}"
    _known(table, _GATE_KEYS, f"keys of {where}")
    for key in ("stage", "score", "reason"):
        if not isinstance(table.get(key), str) or not table[key]:
            raise ConfigError(f"{where}, {key}: expected text, got {table.get(key)!r:.60}")
    if table["stage"] not in STAGES:
        known = ", ".join(STAGES)
        raise ConfigError(f"{where}, stage: expected one of {known}, got {table['stage']!r:.60}")
    if table.get("applies_to", "all") not in get_args(AppliesTo):
        known = ", ".join(get_args(AppliesTo))
        raise ConfigError(f"{where}, applies_to: expected one of {known}, got another")
    limits = {key: table.get(key) for key in ("least", "most")}
    numbers = {
        key: _number(value, f"{where}, {key}") for key, value in limits.items() if value is not None
    }
    if not isinstance(table.get("required", False), bool):
        raise ConfigError(f"{where}, required: expected true or false, got another value")
    return Gate(**table | numbers)


def _quota(quotas: dict[str, Any], kind: str) -> dict[str, int]:
    return {
        name: _count(value, f"quotas.{kind}.{name}") for name, value in _table(quotas, kind).items()
    }


def _table(document: dict[str, Any], key: str) -> dict[str, Any]:
    value = document.get(key, {})
    if not isinstance(value, dict):
        raise ConfigError(f"{key}: expected a table, got {value!r:.60}")
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(f"{where}: expected a number, got {value!r:.60}")
    return float(value)


def _count(value: Any, where: str) -> int:
    if type(value) is not int or value < 0:
        raise ConfigError(f"{where}: expected a whole number of 0 or more, got {value!r:.60}")
    return value


def _known(table: dict[str, Any], known: set[str], what: str) -> None:
    odd = sorted(set(table) - known)
    if odd:
        raise ConfigError(
            f"{what}: expected some of {', '.join(sorted(known))}, got {odd[0]!r:.60}"
        )
