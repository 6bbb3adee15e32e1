"""Drawing compiles ahead of use: announced, once, before processes start, and without a folder."""

import os
import subprocess
import sys
from pathlib import Path

import oracles_drawing as oracle
import pytest

from diff4splat.data_prep import writing
from diff4splat.data_prep.synthetic.renderer.clips import draw_clip
from diff4splat.data_prep.synthetic.renderer.jit import GROUP
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.data_prep.writing import WorldJob, write_worlds
from diff4splat.errors import OutputError
from diff4splat.progress.phases import Phases
from diff4splat.progress.precompile import ensure_precompiled

TINY = WorldRecipe(frames=2, views=1, size_px=(16, 16))


def signatures() -> dict[str, int]:
    return {kernel.py_func.__name__: len(kernel.signatures) for kernel in GROUP.kernels}


def job(folder: Path, clips: int = 1) -> WorldJob:
    draw = DrawSettings(samples_per_side=1, tracks=4, shadow_px=16)
    return WorldJob(folder=folder, clips=clips, recipe=TINY, draw=draw)


@pytest.fixture
def cold(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Kernels that say they are not compiled; the list tells what happens in which order."""
    happened: list[str] = []

    def compile_all(advance) -> float:
        for name in ("shade", "hide"):
            advance(name)
        happened.append("compile")
        return 0.5

    def draw(*asked) -> object:
        happened.append("draw")
        return drawn(*asked)

    drawn = writing._draw
    monkeypatch.setattr(GROUP, "is_ready", lambda: "compile" in happened)
    monkeypatch.setattr(GROUP, "kernel_count", lambda: 2)
    monkeypatch.setattr(GROUP, "precompile", compile_all)
    monkeypatch.setattr(writing, "_draw", draw)
    return happened


def test_warming_up_compiles_everything_that_worlds_need() -> None:
    GROUP.precompile()
    before = signatures()
    assert GROUP.is_ready()
    assert GROUP.kernel_count() == len(before) > 8
    assert set(before.values()) == {1}
    settings = DrawSettings(samples_per_side=2, tracks=20, shadow_px=32, threads=2)
    draw_clip(make_world(TINY, 0), settings)
    draw_clip(oracle.still_life(2, (8, 10)), settings)
    draw_clip(oracle.world([], [oracle.straight(2, (8, 8))], 2), settings)
    assert signatures() == before


def test_what_is_compiled_has_nothing_to_report() -> None:
    GROUP.precompile()
    heard = []
    assert GROUP.precompile(heard.append) >= 0
    assert heard == []
    phases = Phases()
    ensure_precompiled(GROUP, phases)
    assert phases.seconds == {}


def test_clips_are_drawn_after_compilation(cold: list[str], tmp_path: Path) -> None:
    phases = Phases()
    assert write_worlds(job(tmp_path / "clips", 2), phases) == 2
    assert cold == ["compile", "draw", "draw"]
    assert list(phases.seconds) == ["compile", "draw clips"]


def test_nothing_compiles_where_nothing_is_drawn(cold: list[str], tmp_path: Path) -> None:
    write_worlds(job(tmp_path / "clips"), Phases())
    cold.clear()
    assert write_worlds(job(tmp_path / "clips"), Phases(), append=True) == 0
    with pytest.raises(OutputError):
        write_worlds(job(tmp_path / "clips"), Phases())
    assert cold == []


FRESH = """
from diff4splat.data_prep.synthetic.renderer.jit import GROUP
if __name__ == "__main__":
    heard = []
    print(GROUP.is_ready())
    GROUP.precompile(heard.append)
    print(len(heard) == GROUP.kernel_count(), GROUP.is_ready(), GROUP.kernels[0].stats.cache_path)
"""


def fresh(folder: Path) -> str:
    """What an interpreter says whose kernels lie in ``folder``."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FRESH],
        capture_output=True, text=True, timeout=500, check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
    )  # fmt: skip
    return done.stdout


@pytest.mark.slow
def test_a_fresh_machine_compiles_for_good(tmp_path: Path) -> None:
    first = fresh(tmp_path).split()
    assert first[:3] == ["False", "True", "True"]
    assert first[3].startswith(str(tmp_path))
    assert fresh(tmp_path).split()[:3] == ["True", "False", "True"]


@pytest.mark.slow
def test_without_a_folder_to_write_to_every_process_compiles(tmp_path: Path) -> None:
    taken = tmp_path / "a file"
    taken.write_text("")
    assert fresh(taken).split() == ["False", "True", "True", "None"]
