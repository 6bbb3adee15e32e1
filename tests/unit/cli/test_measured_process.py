"""A command in a process of its own ends with the one who measures it."""

import os
from pathlib import Path

import pytest

from diff4splat.cli.calibration import measured_process
from diff4splat.errors import Diff4SplatError


def test_a_measurement_that_is_stopped_ends_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def stop(status: str) -> int:
        seen.append(int(status.split("/")[2]))
        raise KeyboardInterrupt

    monkeypatch.setattr(measured_process, "peak_of_status", stop)
    with pytest.raises(KeyboardInterrupt):
        measured_process.measure_process(["doctor"])
    with pytest.raises(ProcessLookupError):
        os.kill(seen[0], 0)


def test_processor_time_and_what_was_printed() -> None:
    measured = measured_process.measure_process(["--version"])
    assert measured.text.startswith("diff4splat ")
    assert 0 < measured.cpu_seconds < 60
    assert measured.memory_bytes > 1e6


def test_a_look_before_the_program_is_loaded_does_not_count(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(measured_process, "peak_of_status", lambda status: 4096)
    assert measured_process.measure_process(["--version"]).memory_bytes > 1e6


def test_a_command_that_fails_says_what_it_said(tmp_path: Path) -> None:
    with pytest.raises(Diff4SplatError, match=r"expected bake .* to work, got: .*no-such-file"):
        measured_process.measure_process(
            ["bake", str(tmp_path / "no-such-file"), "--out", str(tmp_path / "x.safetensors")]
        )
