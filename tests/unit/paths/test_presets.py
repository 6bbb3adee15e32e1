import math
import re
from pathlib import Path

import pytest

from diff4splat.paths.presets import ALIASES, AMBIGUOUS, PRESETS

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "camera-paths.md"


def test_near_depth_and_turn_amplitudes() -> None:
    assert PRESETS["up"].extent(0.5, 4.0) == 2.0
    assert PRESETS["orbit"].extent(0.5, 4.0) == pytest.approx(math.pi)


def test_other_names_lead_to_presets_and_hide_none() -> None:
    assert {preset for preset, _ in ALIASES.values()} <= set(PRESETS)
    assert not set(ALIASES) & set(PRESETS)
    assert not [name for name in [*PRESETS, *ALIASES] if name.partition("-")[0] in AMBIGUOUS]


def test_defaults_keep_clear_of_the_near_depth() -> None:
    assert all(preset.approach * preset.default_amplitude < 1 for preset in PRESETS.values())


@pytest.mark.parametrize("name", PRESETS)
def test_the_manual_gives_the_default_amplitude(name: str) -> None:
    row = re.search(rf"^\| `{name}` \|.*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert row is not None
    amplitude = row[0].split("|")[3].strip()
    expected = "none" if PRESETS[name].unit == "none" else f"{PRESETS[name].default_amplitude:g}"
    assert amplitude.split(" ")[0] == expected


@pytest.mark.parametrize("name", ALIASES)
def test_the_manual_lists_other_names(name: str) -> None:
    assert f"`{name}`" in PAGE.read_text(encoding="utf-8")


def test_the_program_in_the_manual_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert program is not None
    monkeypatch.chdir(tmp_path)
    exec(program[1], {})
    assert "PathSummary(frames=13" in capsys.readouterr().out
