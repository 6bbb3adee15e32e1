"""How the kernels of the field are compiled, kept and spread over threads."""

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from threading import get_ident

import pytest
import torch

from diff4splat.scene.motion.hexplane import jit


def loaded(folder: Path) -> Callable[[float], float]:
    """A plain function of a module that was read anew."""
    source = folder / "twice.py"
    source.write_text("def twice(x):\n    return 2 * x\n")
    spec = importlib.util.spec_from_file_location("twice", source)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.twice


def test_kernels_are_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "cache_folder", lambda: tmp_path / "kernels")
    assert jit.kernel(loaded(tmp_path))(21.0) == 42.0
    assert list((tmp_path / "kernels").rglob("*.nbi"))


def test_without_a_folder_to_write_to_kernels_compile_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere() -> Path:
        raise PermissionError("read only")

    monkeypatch.setattr(jit, "cache_folder", nowhere)
    assert jit.kernel(loaded(tmp_path))(21.0) == 42.0


def test_kernels_lie_under_a_digest_of_their_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "jit.py"))
    folders = []
    for content in ("a = 1", "a = 2", "a = 1"):
        (tmp_path / "lanes.py").write_text(content)
        folders.append(jit.cache_folder.__wrapped__())
    assert folders[0] == folders[2] != folders[1]
    assert {folder.parent for folder in folders} == {tmp_path / "kernels"}


def test_every_part_is_worked_on_once_and_errors_come_back() -> None:
    done: list[tuple[int, int]] = []
    before = torch.get_num_threads()
    try:
        for threads in (1, 3):
            torch.set_num_threads(threads)
            done.clear()
            jit.spread(lambda part: done.append((part, get_ident())), [(k,) for k in range(20)])
            assert sorted(part for part, _ in done) == list(range(20))
            assert len({thread for _, thread in done}) <= threads
            with pytest.raises(ZeroDivisionError):
                jit.spread(lambda part: 1 // part, [(1,), (0,), (2,)])
    finally:
        torch.set_num_threads(before)


def test_numba_is_loaded_by_the_first_compiled_features_and_not_before() -> None:
    code = (
        "import sys, torch\n"
        "from diff4splat.scene.motion.hexplane import motion, planes, regularisers\n"
        "from diff4splat.scene.motion import bake\n"
        "made = planes.make_planes(planes.HexPlaneSize(), torch.eye(3)[:2], (0.0, 1.0))\n"
        "made.to(torch.float64).features(torch.zeros(1, 3, dtype=torch.float64), 0.5)\n"
        "assert 'numba' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
