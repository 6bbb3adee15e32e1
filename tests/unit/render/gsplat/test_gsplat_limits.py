"""What gsplat is not asked to do, and how that is said."""

import builtins
import re
import sys
from collections.abc import Iterator
from dataclasses import fields, replace
from types import ModuleType

import fake_gsplat
import pytest
import torch
from oracles_gsplat import extreme_view, random_view
from torch._subclasses.fake_tensor import FakeTensorMode

from diff4splat.render.gsplat import backend, limits
from diff4splat.render.settings import RenderJob, RenderSettings
from diff4splat.scene.gaussians import Gaussians

GAUSSIANS, CAMERA = random_view(edge_px=6, count=5)
JOB = RenderJob(
    gaussians=GAUSSIANS,
    camera=CAMERA,
    outputs=frozenset({"rgb"}),
    settings=RenderSettings(),
    flow_gaussians=GAUSSIANS,
    flow_camera=CAMERA,
)
UNUSABLE = (float("nan"), float("inf"), 1e30)
"""Such Gaussians are left out, so they are no reason to refuse the others."""


@pytest.fixture(autouse=True)
def _forgetful() -> Iterator[None]:
    """What was found out about the installation does not outlive a test."""
    backend.loading_problem.cache_clear()
    yield
    backend.loading_problem.cache_clear()


@pytest.fixture
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stand-in for gsplat 1.5 is there and takes CPU tensors."""
    fake_gsplat.install(monkeypatch)
    monkeypatch.setattr(limits, "DEVICE_TYPE", "cpu")


def with_settings(**changes: object) -> RenderJob:
    return replace(JOB, settings=RenderSettings(**changes))


def with_gaussians(**changes: object) -> RenderJob:
    return replace(JOB, gaussians=extreme_view(**changes)[0])


@pytest.mark.usefixtures("_installed")
def test_the_defaults_are_not_refused() -> None:
    assert backend.unsupported_reason(JOB) is None


def test_tensors_on_a_cpu_are_refused_before_gsplat_is_imported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def never(name: str, *args: object, **kwargs: object) -> ModuleType:
        assert not name.startswith("gsplat")
        return original(name, *args, **kwargs)

    original = builtins.__import__
    monkeypatch.setattr(builtins, "__import__", never)
    assert backend.unsupported_reason(JOB) == "expected a CUDA tensor, got cpu"


def test_tensors_on_a_gpu_are_taken() -> None:
    with FakeTensorMode():
        shapes = {field.name: getattr(GAUSSIANS, field.name).shape for field in fields(GAUSSIANS)}
        there = {name: torch.empty(shape, device="cuda") for name, shape in shapes.items()}
        job = replace(JOB, gaussians=Gaussians(**there))
    assert limits.tensor_limit(job) is None


@pytest.mark.usefixtures("_installed")
@pytest.mark.parametrize(
    ("job", "reason"),
    [
        (
            replace(JOB, gaussians=GAUSSIANS.to(torch.float64)),
            r"expected float32, got torch\.float64",
        ),
        (
            replace(JOB, outputs=frozenset({"rgb", "median_depth"})),
            "expected outputs among rgb, depth, alpha, flow, features, got median_depth",
        ),
        (with_settings(alpha_cutoff=0.01), "expected alpha_cutoff 0.00392157, .* fixes, got 0.01"),
        (with_settings(light_cutoff=1e-3), "expected light_cutoff 0.0001, .* fixes, got 0.001"),
        (with_settings(tile_px=8), "expected tile_px 16, .* fixes, got 8"),
        (
            with_settings(alpha_max=0.99),
            r"expected alpha_max 0.999, which gsplat 1\.5\.3 fixes, got",
        ),
        (
            with_gaussians(scales=1e15),
            r"expected footprints below 1e\+08 px, got [0-9]e\+1[56] px",
        ),
        (with_gaussians(opacities=5.0), "expected opacities of at most 1, got 5"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_refused_is_said(job: RenderJob, reason: str) -> None:
    assert re.fullmatch(reason + ".*", backend.unsupported_reason(job))


@pytest.mark.usefixtures("_installed")
@pytest.mark.parametrize(
    "job",
    [
        with_settings(tile_px=16),
        with_settings(antialias=True, dilation_px2=0.0),
        with_gaussians(scales=1e15, means=[0.0, 0.0, -2.0]),
        with_gaussians(scales=1e3),
        *(with_gaussians(scales=value) for value in UNUSABLE),
        *(with_gaussians(opacities=value) for value in UNUSABLE),
        *(with_gaussians(means=value) for value in UNUSABLE),
        replace(JOB, gaussians=GAUSSIANS.select(torch.zeros(0, dtype=torch.long))),
    ],
)
def test_what_does_no_harm_is_not_refused(job: RenderJob) -> None:
    assert backend.unsupported_reason(job) is None


@pytest.mark.usefixtures("_installed")
@pytest.mark.parametrize("name", ["focal_px", "center_px"])
def test_lenses_that_want_a_gradient_are_refused(name: str) -> None:
    leaf = getattr(CAMERA, name).clone().requires_grad_()
    job = replace(JOB, camera=replace(CAMERA, **{name: leaf}))
    reason = "expected focal_px and center_px that need no gradient, got requires_grad"
    assert backend.unsupported_reason(job) == reason
    with torch.no_grad():
        assert backend.unsupported_reason(job) is None
    assert backend.unsupported_reason(replace(JOB, flow_camera=job.camera)) is None


@pytest.mark.parametrize(("alpha_max", "refused"), [(0.999, True), (0.99, False)])
def test_another_version_has_other_constants(
    monkeypatch: pytest.MonkeyPatch, alpha_max: float, refused: bool
) -> None:
    fake_gsplat.install(monkeypatch, "1.6.0")
    monkeypatch.setattr(limits, "DEVICE_TYPE", "cpu")
    job = with_settings(alpha_max=alpha_max)
    reason = "expected alpha_max 0.99, which gsplat 1.6.0 fixes, got 0.999"
    assert backend.unsupported_reason(job) == (reason if refused else None)


def test_a_version_that_dims_only_so_far_is_not_used_for_antialias(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fake_gsplat.install(monkeypatch, "1.6.0")
    monkeypatch.setattr(limits, "DEVICE_TYPE", "cpu")
    reason = backend.unsupported_reason(with_settings(alpha_max=0.99, antialias=True))
    assert reason == "expected no antialias, because gsplat 1.6.0 never dims below 0.005, got it"


class Nowhere:
    """What Python finds where gsplat is not installed."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name.partition(".")[0] == "gsplat":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def test_a_missing_library_is_answered_with_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "DEVICE_TYPE", "cpu")
    monkeypatch.setattr(sys, "meta_path", [Nowhere(), *sys.meta_path])
    for name in [name for name in sys.modules if name.partition(".")[0] == "gsplat"]:
        monkeypatch.delitem(sys.modules, name)
    reason = "gsplat is not installed: pip install 'diff4splat[cuda]'"
    assert backend.unsupported_reason(JOB) == reason


@pytest.mark.usefixtures("_installed")
def test_a_library_without_kernels_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["gsplat.cuda._backend"], "_C", None)
    assert "expected gsplat with CUDA kernels, got none" in backend.unsupported_reason(JOB)


@pytest.mark.usefixtures("_installed")
@pytest.mark.parametrize("error", [ImportError, OSError, RuntimeError])
def test_a_compiler_that_fails_is_asked_once_and_quoted_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: type[Exception],
) -> None:
    asked = []

    class Failing(ModuleType):
        def __getattr__(self, name: str) -> object:
            if name != "_C":
                raise AttributeError(name)
            asked.append(name)
            print("compiling")
            raise error("no nvcc\nand many more lines")

    monkeypatch.setitem(sys.modules, "gsplat.cuda._backend", Failing("gsplat.cuda._backend"))
    for _ in range(2):
        assert backend.unsupported_reason(JOB) == "expected gsplat with CUDA kernels, got no nvcc"
    assert len(asked) == 1
    assert capsys.readouterr() == ("", "compiling\n")
