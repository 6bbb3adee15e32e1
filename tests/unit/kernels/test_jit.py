"""Kernels compile once per machine and are cached on disk, as far as the disk allows it."""

import importlib.util
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from diff4splat.data_prep.synthetic.renderer.jit import GROUP as DRAWING
from diff4splat.kernels import jit
from diff4splat.kernels.group import KernelGroup
from diff4splat.render.raster.jit import GROUP as RASTER
from diff4splat.render.trace.jit import GROUP as TRACE
from diff4splat.scene.motion.hexplane.jit import GROUP as HEXPLANE

GROUPS = pytest.mark.parametrize(
    "group", [RASTER, TRACE, HEXPLANE, DRAWING], ids=lambda group: group.title
)


@pytest.fixture(autouse=True)
def empty_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels of these tests are not those that `doctor --warm` precompiles."""
    for group in (RASTER, TRACE, HEXPLANE, DRAWING):
        monkeypatch.setattr(group, "_listed", [])


@pytest.fixture
def twice(tmp_path: Path) -> Callable[[], Any]:
    """Loads a module anew and gives its one function."""
    source = tmp_path / "twice.py"
    source.write_text("def twice(x):\n    return 2 * x\n")

    def load() -> Callable[[float], float]:
        spec = importlib.util.spec_from_file_location("twice", source)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.twice

    return load


@GROUPS
def test_a_kernel_is_ready_once_it_was_compiled_anywhere(
    group: KernelGroup,
    twice: Callable[[], Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(jit, "cache_folder", lambda *sources: tmp_path / "kernels")
    first = group.kernel(twice())
    assert not jit.is_compiled(first)
    assert first(21.0) == 42.0
    assert list((tmp_path / "kernels").rglob("*.nbi"))
    assert jit.is_compiled(first)
    again = group.kernel(twice())
    assert jit.is_compiled(again)
    assert again(21.0) == 42.0
    assert sum(again.stats.cache_hits.values()) == 1


@GROUPS
def test_without_a_folder_to_write_to_kernels_compile_all_the_same(
    group: KernelGroup, twice: Callable[[], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere(*sources: Path) -> Path:
        raise PermissionError("read only")

    monkeypatch.setattr(jit, "cache_folder", nowhere)
    kernel = group.kernel(twice())
    assert not jit.is_compiled(kernel)
    assert kernel(21.0) == 42.0
    assert jit.is_compiled(kernel)


def test_a_full_disk_costs_time_and_not_the_run(
    twice: Callable[[], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: object, name: str, data: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(jit, "cache_folder", lambda *sources: tmp_path / "kernels")
    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile._save_data", full)
    assert jit.cached_njit(twice(), {})(21.0) == 42.0
    monkeypatch.undo()
    monkeypatch.setattr(jit, "cache_folder", lambda *sources: tmp_path / "kernels")
    # What it left behind does not stop the next run, which finds room.
    assert jit.cached_njit(twice(), {})(21.0) == 42.0
    third = jit.cached_njit(twice(), {})
    assert third(21.0) == 42.0
    assert sum(third.stats.cache_hits.values()) == 1


def test_kernels_lie_under_a_digest_of_their_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    for name in ("own", "others"):
        (tmp_path / name / "deeper").mkdir(parents=True)
    folders = []
    for own, other in (("1", "1"), ("2", "1"), ("1", "2"), ("1", "1")):
        (tmp_path / "own" / "footprint.py").write_text(f"a = {own}")
        (tmp_path / "others" / "deeper" / "vectors.py").write_text(f"b = {other}")
        folders.append(jit.cache_folder.__wrapped__(tmp_path / "own", tmp_path / "others"))
    assert folders[0] == folders[3]
    assert len(set(folders)) == 3
    assert {folder.parent for folder in folders} == {tmp_path / "kernels"}


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to the superuser")
def test_a_folder_that_may_not_be_written_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    jit.cache_folder.__wrapped__().chmod(0o500)
    with pytest.raises(PermissionError, match="expected a folder to write to"):
        jit.cache_folder.__wrapped__()


@pytest.mark.parametrize("damage", [b"", b"noise" * 40, None], ids=["empty", "noise", "cut off"])
def test_damaged_files_are_compiled_again(
    damage: bytes | None,
    twice: Callable[[], Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(jit, "cache_folder", lambda *sources: tmp_path / "kernels")
    assert RASTER.kernel(twice())(21.0) == 42.0
    files = [file for file in (tmp_path / "kernels").rglob("*") if file.is_file()]
    for suffix in (".nbi", ".nbc", ".sha256"):
        for file in files:
            if file.suffix == suffix:
                whole = file.read_bytes()
                file.write_bytes(whole[:-1] if damage is None else damage)
        again = RASTER.kernel(twice())
        assert again(21.0) == 42.0
        assert sum(again.stats.cache_misses.values()) == 1
        healed = RASTER.kernel(twice())
        assert healed(21.0) == 42.0
        assert sum(healed.stats.cache_hits.values()) == 1
