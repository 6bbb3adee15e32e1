"""The calibration table: rates of commands, and what each setting loses on measured inputs.

JSON, versioned. One ships with the package (``calibration.json``); ``diff4splat report calibrate``
writes another for this machine, which is then found in the user's cache.
"""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from diff4splat import __version__
from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.io.require_file import read_text
from diff4splat.outputs.budgets.costs import CostRates
from diff4splat.paths.formats.json_text import decode_object

FORMAT = "diff4splat calibration 2"
SHIPPED = "calibration.json"
RENEW = "diff4splat report calibrate writes a new one"
MAX_ROWS = 10_000
SettingValues = Mapping[str, float | int | bool | str]


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingRow:
    """One setting of one command, and its error."""

    values: SettingValues
    error: float
    """Largest over the inputs; mean square of RGB, or its share of the photograph's detail."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationTable:
    """Everything that was measured."""

    diff4splat: str
    machine: str
    speed_s: float
    """Seconds of ``measure_speed_s`` on that machine."""
    load: float
    """Other threads that ran meanwhile, the mean over the runs."""
    inputs: tuple[str, ...]
    rates: Mapping[str, CostRates]
    settings: Mapping[str, tuple[SettingRow, ...]]

    def of(self, command: str) -> tuple[CostRates, tuple[SettingRow, ...]]:
        """Rates and settings of a command.

        Raises:
            ConfigError: the table does not know it.
        """
        if command not in self.rates:
            known = ", ".join(sorted(self.rates))
            raise ConfigError(
                f"calibration: expected rates of {command}, got those of {known}; {RENEW}"
            )
        return self.rates[command], self.settings.get(command, ())

    def rates_at(self, speed_s: float) -> dict[str, CostRates]:
        """The rates on a machine that takes ``speed_s`` for what this one took ``self.speed_s``."""
        times = speed_s / self.speed_s
        return {
            name: replace(one, seconds={key: times * rate for key, rate in one.seconds.items()})
            for name, one in self.rates.items()
        }


def user_table_file() -> Path:
    """Where ``report calibrate`` puts the table of this machine."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "diff4splat" / SHIPPED


def find_table(file: Path | None = None) -> CalibrationTable:
    """The table of ``file``, else that of this machine, else the one that ships.

    Raises:
        InputError, FileFormatError: ``file`` is not there, or damaged.
        ConfigError: it belongs to another version.
    """
    if file is not None:
        return read_table(file)
    own = user_table_file()
    if own.is_file():
        try:
            return read_table(own)
        except (ConfigError, FileFormatError):
            pass  # Damaged or of an older version: the one that ships fits this one.
    return parse_table(
        resources.files("diff4splat.outputs.budgets").joinpath(SHIPPED).read_text(), SHIPPED
    )


def read_table(file: Path) -> CalibrationTable:
    """A table from a file.

    Raises:
        FileFormatError: it cannot be read, or is none.
        ConfigError: it belongs to another version.
    """
    return parse_table(read_text(file, "a calibration table"), str(file))


def parse_table(text: str, where: str) -> CalibrationTable:
    """A table from JSON; every number is checked.

    Raises:
        FileFormatError: it is none.
        ConfigError: it belongs to another version.
    """
    try:
        source = decode_object(text)
        if source.get("format") != FORMAT:
            raise FileFormatError(f"expected format {FORMAT!r}, got {str(source.get('format'))!r}")
        table = _table(source)
    except (FileFormatError, KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise FileFormatError(
            f"{where}: expected a calibration table, got {reason}; {RENEW}"
        ) from (error)
    if table.diff4splat != __version__:
        raise ConfigError(
            f"{where}: expected a calibration of diff4splat {__version__}, "
            f"got one of {table.diff4splat}; {RENEW}"
        )
    return table


def write_table(table: CalibrationTable, file: Path) -> None:
    """Write the table, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    record = {"format": FORMAT} | asdict(table)
    write_text(file, json.dumps(record, indent=1, allow_nan=False) + "\n")


def _table(source: Mapping[str, object]) -> CalibrationTable:
    return CalibrationTable(
        diff4splat=_text(source["diff4splat"]),
        machine=_text(source["machine"]),
        speed_s=_number(source["speed_s"], least=1e-9),
        load=_number(source["load"]),
        inputs=tuple(map(_text, source["inputs"])),
        rates={name: _rates(one) for name, one in _object(source["rates"]).items()},
        settings={name: _rows(rows) for name, rows in _object(source["settings"]).items()},
    )


def _rates(source: Mapping[str, Mapping[str, float]]) -> CostRates:
    seconds, memory = _object(source["seconds"]), _object(source["memory_bytes"])
    return CostRates(
        seconds={name: _number(rate) for name, rate in seconds.items()},
        memory_bytes={name: _number(rate) for name, rate in memory.items()},
    )


def _rows(source: list[Mapping[str, object]]) -> tuple[SettingRow, ...]:
    if not isinstance(source, list) or len(source) > MAX_ROWS:
        raise FileFormatError(f"expected at most {MAX_ROWS} settings in a list")
    return tuple(
        SettingRow(values=_values(row["values"]), error=_number(row["error"])) for row in source
    )


def _values(source: Mapping[str, object]) -> SettingValues:
    values = _object(source)
    if not all(isinstance(value, (int, float, str)) for value in values.values()):
        raise FileFormatError("expected numbers and words as settings")
    return values


def _object(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FileFormatError(f"expected an object, got {str(value)[:40]!r}")
    return value


def _text(value: object) -> str:
    if not isinstance(value, str) or not value:
        raise FileFormatError(f"expected text, got {str(value)[:40]!r}")
    return value


def _number(value: object, least: float = 0.0) -> float:
    usable = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not usable or not math.isfinite(value) or value < least:
        raise FileFormatError(f"expected numbers of at least {least:g}, got {str(value)[:40]!r}")
    return float(value)
