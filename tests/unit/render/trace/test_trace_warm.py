"""Compilation is seen, happens once, and reaches every kernel."""

import pytest

from diff4splat.render.raster import jit
from diff4splat.render.trace import compiled, warm


def test_warming_reaches_every_kernel() -> None:
    warm.ensure_compiled()
    heard: list[str] = []
    assert warm.warm(heard.append) >= 0
    assert warm.is_ready()
    assert warm.kernel_count() == len(compiled.KERNELS) > 10
    assert all(kernel.signatures for kernel in compiled.KERNELS)
    # They are compiled already; nothing is heard of them again.
    assert not heard


def test_kernels_are_kept_apart_from_those_of_the_rasteriser() -> None:
    assert not any(kernel in jit.KERNELS for kernel in compiled.KERNELS)


def test_the_first_rays_say_that_they_wait(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    warm.ensure_compiled()
    monkeypatch.setattr(warm, "is_ready", lambda: False)
    warm._compile_once.__wrapped__()
    said = capsys.readouterr().err
    assert said.startswith("diff4splat: compiling the ray tracer, once for this machine:")
    assert "ready after" in said
    monkeypatch.setattr(warm, "is_ready", lambda: True)
    warm._compile_once.__wrapped__()
    assert capsys.readouterr().err == ""
