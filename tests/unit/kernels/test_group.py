"""A group compiles its kernels once, reports it, and counts them."""

import sys
from pathlib import Path
from types import ModuleType

import pytest

from diff4splat.kernels.group import KernelGroup
from diff4splat.kernels.jit import EXACT


@pytest.fixture
def group(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> KernelGroup:
    """A group of one kernel, whose warm-up module is ``tiny_warm_up``."""
    monkeypatch.setattr("diff4splat.kernels.jit.cache_folder", lambda *sources: tmp_path)
    module = ModuleType("tiny_warm_up")
    monkeypatch.setitem(sys.modules, "tiny_warm_up", module)
    group = KernelGroup(
        "tiny kernels", options=EXACT, sources=(), warm_up="tiny_warm_up", compile_s=1
    )

    @group.kernel
    def twice(x):
        return 2 * x

    module.warm_up = lambda: twice(1.0)
    return group


def test_each_kernel_is_reported_once(group: KernelGroup) -> None:
    assert group.kernel_count() == 1
    assert not group.is_ready()
    compiled: list[str] = []
    assert group.precompile(compiled.append) >= 0
    assert compiled == ["twice"]
    assert group.is_ready()
    group.precompile(compiled.append)
    assert compiled == ["twice"]


def test_the_first_use_reports_that_it_compiles(
    group: KernelGroup, capsys: pytest.CaptureFixture[str]
) -> None:
    group.ensure_compiled()
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "diff4splat: compiling tiny kernels, once for this machine: twice"
    assert lines[1].startswith("diff4splat: ready after ")
    group.ensure_compiled()
    assert capsys.readouterr().err == ""


def test_a_program_without_a_console_compiles_silently(
    group: KernelGroup, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", None)
    group.ensure_compiled()
    assert group.is_ready()


def test_kernels_of_a_ready_group_are_not_reported(
    group: KernelGroup, capsys: pytest.CaptureFixture[str]
) -> None:
    group.precompile()
    group.ensure_compiled()
    assert capsys.readouterr().err == ""
