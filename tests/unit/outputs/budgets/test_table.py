"""Calibration tables: the one that ships, and files that are none."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.outputs.budgets.table import (
    CalibrationTable,
    find_table,
    read_table,
    user_table_file,
    write_table,
)

COMMANDS = ("generate", "render", "bake", "export html", "fit")


@pytest.fixture(autouse=True)
def no_table_of_this_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def shipped() -> CalibrationTable:
    return find_table()


@pytest.mark.parametrize("command", COMMANDS)
def test_the_table_that_ships_knows_every_command(shipped: CalibrationTable, command: str) -> None:
    rates, rows = shipped.of(command)
    assert rates.seconds and rates.memory_bytes
    assert bool(rows) == (command != "fit")


def test_a_table_survives_its_file(shipped: CalibrationTable, tmp_path: Path) -> None:
    write_table(shipped, tmp_path / "table.json")
    assert read_table(tmp_path / "table.json") == shipped


def test_the_table_of_this_machine_comes_first(shipped: CalibrationTable) -> None:
    write_table(replace(shipped, machine="mine"), user_table_file())
    assert find_table().machine == "mine"


def test_a_table_of_another_version(shipped: CalibrationTable, tmp_path: Path) -> None:
    old = replace(shipped, diff4splat="0.0.1")
    write_table(old, tmp_path / "old.json")
    with pytest.raises(ConfigError, match=r"one of 0.0.1; .*report calibrate"):
        find_table(tmp_path / "old.json")
    write_table(old, user_table_file())
    assert find_table().diff4splat != "0.0.1"


@pytest.mark.parametrize(
    "change",
    [
        {"format": "other"},
        {"speed_s": -1},
        {"speed_s": "1"},
        {"rates": []},
        {"rates": {"generate": {"seconds": {"start": float("1e999")}, "memory_bytes": {}}}},
        {"settings": {"generate": [{"values": {}, "error": None}]}},
        {"settings": {"generate": {}}},
        {"settings": {"generate": [{"values": {"a": [1]}, "error": 1}]}},
        {"inputs": 3},
    ],
)
def test_damaged_tables(shipped: CalibrationTable, tmp_path: Path, change: dict) -> None:
    file = tmp_path / "table.json"
    write_table(shipped, file)
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(FileFormatError, match=r"report calibrate"):
        read_table(file)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "diff4splat calibration 1"}', "\0"])
def test_files_that_are_none(tmp_path: Path, text: str) -> None:
    file = tmp_path / "table.json"
    file.write_text(text)
    with pytest.raises((FileFormatError, InputError)):
        read_table(file)
