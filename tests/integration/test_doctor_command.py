"""``diff4splat doctor``, and how other commands get their renderer ready."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest
import torch
from PIL import Image

from diff4splat.cli import doctor
from diff4splat.cli.common import installation
from diff4splat.cli.common.console import ConsolePhases
from diff4splat.cli.common.precompile import GROUPS, precompile_sources
from diff4splat.cli.main import run
from diff4splat.data_prep.synthetic.renderer.jit import GROUP as WORLDS
from diff4splat.errors import ConfigError
from diff4splat.geometry.camera import pinhole
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.kernels.group import KernelGroup
from diff4splat.paths.camera_path import CameraPath
from diff4splat.render.backends import BACKENDS
from diff4splat.render.raster import backend
from diff4splat.render.raster.jit import GROUP as RASTER
from diff4splat.render.trace import support
from diff4splat.render.trace.jit import GROUP as TRACE
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane.jit import GROUP as HEXPLANE
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.scene.scene import Provenance, Scene
from diff4splat.training.recipe.data import SourceSettings

KERNELS = ("project", "blend")
DRAWING = ("shade", "hide", "read")
TRACING = ("prepare", "shade", "rewind", "finish")
FIELDS = ("read", "accumulate")
OTHERS = {"worlds", "renderer trace", "hexplane fields"}
ALL_ROWS = {
    "diff4splat", "python", "platform", "cpu", "memory", "torch", "cuda", "self-test", *OTHERS,
}  # fmt: skip


@pytest.fixture(autouse=True)
def _without_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)


@pytest.fixture
def cold(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A renderer that says it is not compiled; the list fills when somebody compiles it."""
    monkeypatch.setattr(RASTER, "ensure_compiled", lambda: None)
    return not_compiled(monkeypatch, RASTER, KERNELS)


@pytest.fixture
def cold_drawing(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The same of what draws worlds."""
    return not_compiled(monkeypatch, WORLDS, DRAWING)


@pytest.fixture
def cold_tracer(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The same of the ray tracer."""
    return not_compiled(monkeypatch, TRACE, TRACING)


@pytest.fixture
def cold_fields(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The same of HexPlane fields."""
    return not_compiled(monkeypatch, HEXPLANE, FIELDS)


def not_compiled(
    monkeypatch: pytest.MonkeyPatch, group: KernelGroup, names: tuple[str, ...]
) -> list[str]:
    compiled: list[str] = []

    def compile_all(advance: Callable[[str], None]) -> float:
        for name in names:
            advance(name)
        compiled.extend(names)
        return 0.5

    monkeypatch.setattr(group, "is_ready", lambda: bool(compiled))
    monkeypatch.setattr(group, "kernel_count", lambda: len(names))
    monkeypatch.setattr(group, "precompile", compile_all)
    return compiled


def scene_file(folder: Path, dtype: torch.dtype = torch.float32, bad: int = 0) -> Path:
    """Five Gaussians before one camera, the first ``bad`` of them too large to be squared."""
    scales = torch.full((5, 3), 0.1)
    scales[:bad] = 1e30
    gaussians = Gaussians(
        means=torch.tensor([[0.0, 0.0, 2.0]]).repeat(5, 1),
        quats=torch.tensor([[1.0, 0.0, 0.0, 0.0]]).repeat(5, 1),
        scales=scales,
        opacities=torch.full((5,), 0.5),
        sh=torch.zeros(5, 1, 3),
    ).to(dtype)
    path = CameraPath(
        cameras=pinhole(16.0, (16, 16)).with_pose(torch.eye(4).repeat(2, 1, 1)),
        times_s=torch.tensor([0.0, 0.5]),
    )
    scene = Scene(
        gaussians=gaussians,
        motion=StaticMotion(),
        path=path,
        provenance=Provenance(generator="test"),
    )
    save_scene(scene, folder / "scene.safetensors")
    return folder / "scene.safetensors"


def rows(shown: str) -> dict[str, str]:
    return {line[:20].strip(): line[20:] for line in shown.splitlines()}


def test_a_healthy_installation(capsys: pytest.CaptureFixture) -> None:
    assert run(["doctor"]) == 0
    table = rows(capsys.readouterr().out)
    assert ALL_ROWS | {f"renderer {name}" for name in BACKENDS} <= set(table)
    assert table["python"].startswith(".".join(map(str, sys.version_info[:3])))
    assert table["torch"].startswith(torch.__version__)
    assert table["renderer reference"] == "ready"
    assert table["matplotlib"] == metadata.version("matplotlib")
    assert "agrees with float64" in table["self-test"]
    assert all(value.strip() for value in table.values())


def test_what_is_not_compiled_is_said_and_not_compiled(
    cold: list[str],
    cold_drawing: list[str],
    cold_tracer: list[str],
    cold_fields: list[str],
    capsys: pytest.CaptureFixture,
) -> None:
    assert run(["doctor"]) == 0
    table = rows(capsys.readouterr().out)
    groups = (WORLDS, HEXPLANE, RASTER, TRACE)
    for name, group in zip(GROUPS, groups, strict=True):
        assert f"will compile on first use (about {group.compile_s} s)" in table[name]
        assert "doctor --warm" in table[name]
    assert cold_drawing == cold_tracer == cold_fields == []
    assert table["self-test"].startswith("renderer reference")
    assert cold == []


def test_a_back_end_that_refuses_says_why(
    cold_drawing: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(
        backend, "unsupported_reason", lambda job: "expected a fast CPU, got a slow one"
    )
    assert run(["doctor"]) == 0
    table = rows(capsys.readouterr().out)
    assert table["renderer raster"] == "refuses: expected a fast CPU, got a slow one"
    assert run(["doctor", "--warm"]) == 2
    assert "renderer raster: expected a fast CPU" in capsys.readouterr().err
    assert cold_drawing == list(DRAWING)


def test_with_a_gpu_every_back_end_is_asked_twice(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda: "a fast one")
    refusals = {"cpu": None, "cuda": "expected CPU tensors, got cuda"}
    monkeypatch.setattr(installation, "unsupported_reason", lambda name, device: refusals[device])
    monkeypatch.setattr(installation, "self_test", lambda: "fine")
    assert run(["doctor"]) == 0
    shown = capsys.readouterr().out
    assert "a fast one" in rows(shown)["cuda"]
    assert "renderer reference  cpu: ready\n" in shown
    assert "renderer reference  cuda: refuses: expected CPU tensors, got cuda\n" in shown


def test_an_extra_that_is_missing_comes_with_its_pip_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    extra = ("no-such-package", "singing", "pip install 'diff4splat[song]'")
    monkeypatch.setattr(doctor, "EXTRAS", (extra,))
    assert run(["doctor"]) == 0
    shown = rows(capsys.readouterr().out)["no-such-package"]
    assert shown == "not installed; for singing: pip install 'diff4splat[song]'"


@pytest.mark.parametrize(
    ("what", "value", "message"),
    [
        (
            "LIBRARIES",
            ("diff4splat.no_such_module",),
            "expected every library to load, got No module named 'diff4splat.no_such_module'",
        ),
        ("TOLERANCE", 0.0, "expected the image of float64 within 0"),
    ],
)
def test_what_is_broken_ends_in_one_line(
    what: str,
    value: object,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.setattr(installation, what, value)
    assert run(["doctor"]) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert len(shown.err.splitlines()) == 1
    assert {"python", "cpu"} <= set(rows(shown.out))


def test_a_package_that_is_missing_comes_with_its_pip_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    asked = ["torch>=2.6", "no-such-package>=3,<4", 'other-package; extra == "dev"']
    monkeypatch.setattr(metadata, "requires", lambda name: asked)
    assert run(["doctor"]) == 2
    shown = capsys.readouterr().err
    assert "expected no-such-package>=3,<4, got none" in shown
    assert "pip install 'no-such-package>=3,<4'" in shown
    assert "other-package" not in shown
    assert "torch" not in shown


def test_warm_compiles_once(
    cold: list[str],
    cold_drawing: list[str],
    cold_tracer: list[str],
    cold_fields: list[str],
    capsys: pytest.CaptureFixture,
) -> None:
    assert run(["doctor", "--warm"]) == 0
    shown = capsys.readouterr()
    assert "renderer raster: compiled 2 kernels in" in shown.err
    assert "worlds: compiled 3 kernels in" in shown.err
    assert "renderer trace: compiled 4 kernels in" in shown.err
    assert "hexplane fields: compiled 2 kernels in" in shown.err
    assert shown.err.count("compile   ") == 4
    assert shown.out == ""
    assert cold == list(KERNELS)
    assert cold_drawing == list(DRAWING)
    assert cold_tracer == list(TRACING)
    assert cold_fields == list(FIELDS)
    assert run(["doctor"]) == 0
    table = rows(capsys.readouterr().out)
    assert {table[name] for name in OTHERS} == {"ready"}


def test_warm_says_when_there_was_nothing_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    for group in (RASTER, WORLDS, TRACE, HEXPLANE):
        monkeypatch.setattr(group, "precompile", lambda on_kernel: 0.1)
    assert run(["doctor", "--warm"]) == 0
    shown = capsys.readouterr().err
    for name in ("renderer raster", *OTHERS):
        assert f"{name}: was already compiled; loaded in" in shown


def test_a_tracer_that_refuses_says_why(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(
        support, "unsupported_reason", lambda gaussians: "expected the package numba"
    )
    assert run(["doctor"]) == 0
    table = rows(capsys.readouterr().out)
    assert table["renderer trace"] == "refuses: expected the package numba"


def test_warm_says_when_nothing_can_be_kept(
    cold_drawing: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(WORLDS.kernels[0]._cache, "_cache_path", None)
    doctor.precompile_group("worlds")
    assert "not kept, because no folder can be written to" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kinds", "happens"), [((), ()), (("shards",), ()), (("shards", "worlds"), DRAWING)]
)
def test_sources_compile_what_draws_worlds_where_one_of_them_is_worlds(
    kinds: tuple[str, ...],
    happens: tuple[str, ...],
    cold_drawing: list[str],
    capsys: pytest.CaptureFixture,
) -> None:
    phases = ConsolePhases()
    sources = [SourceSettings(kind=kind, folder="clips") for kind in kinds]
    precompile_sources(sources, phases)
    assert cold_drawing == list(happens)
    assert ("compile   " in capsys.readouterr().err) == bool(happens)
    precompile_sources(sources, phases)
    assert cold_drawing == list(happens)


def test_render_compiles_ahead_in_its_own_phase(
    cold: list[str], tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    arguments = ["render", str(scene_file(tmp_path)), "--out", str(tmp_path / "a.png")]
    assert run(arguments) == 0
    assert cold == list(KERNELS)
    assert "compile   " in capsys.readouterr().err
    assert run(arguments) == 0
    assert cold == list(KERNELS)
    assert "compile   " not in capsys.readouterr().err


def test_generate_counts_the_seconds_of_compilation(cold: list[str], tmp_path: Path) -> None:
    Image.radial_gradient("L").convert("RGB").resize((48, 32)).save(tmp_path / "photo.png")
    arguments = ["generate", str(tmp_path / "photo.png"), "--model", "test", "--steps", "1"]
    assert run([*arguments, "--frames", "2", "--out", str(tmp_path / "out")]) == 0
    assert cold == list(KERNELS)
    assert "compile" in json.loads((tmp_path / "out" / "card.json").read_text())["seconds"]


def stopped(*asked: object) -> None:
    raise ConfigError("stopped before any work")


@pytest.mark.parametrize(("source", "happens"), [("worlds", DRAWING), ("shards", ())])
def test_train_compiles_what_draws_its_worlds_ahead(
    source: str,
    happens: tuple[str, ...],
    cold_drawing: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("diff4splat.training.train_stage.train_stage", stopped)
    change = f'stages.vae.data.sources=[{{"kind": "{source}", "folder": "clips"}}]'
    arguments = ["train", "--config", "test", "--stage", "vae", "--set", change]
    assert run([*arguments, "--out", str(tmp_path)]) == 2
    assert cold_drawing == list(happens)


def test_eval_compiles_what_draws_its_worlds_ahead(
    cold_drawing: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("diff4splat.evaluation.evaluate.evaluate", stopped)
    assert run(["eval", "--model", "test", "--out", str(tmp_path)]) == 2
    assert cold_drawing == list(DRAWING)


def test_double_precision_compiles_nothing(cold: list[str], tmp_path: Path) -> None:
    file = scene_file(tmp_path, torch.float64)
    assert run(["render", str(file), "--out", str(tmp_path / "a.png")]) == 0
    assert cold == []


def test_a_wrong_output_is_refused_before_anything_compiles(
    cold: list[str], tmp_path: Path
) -> None:
    assert run(["render", str(scene_file(tmp_path)), "--out", str(tmp_path / "a.bmp")]) == 2
    assert cold == []


def test_gaussians_that_cannot_be_drawn_are_counted_once(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    file = scene_file(tmp_path, bad=2)
    assert run(["render", str(file), "--out", str(tmp_path / "a.mp4")]) == 0
    shown = capsys.readouterr().err
    note = "2 Gaussians left out of the first frame: 2 with scales that are not finite or too large"
    assert shown.count(note) == 1
    assert run(["render", str(scene_file(tmp_path)), "--out", str(tmp_path / "a.mp4")]) == 0
    assert "left out" not in capsys.readouterr().err


def test_commands_that_draw_nothing_load_no_compiler(tmp_path: Path) -> None:
    scene = str(scene_file(tmp_path))
    code = (
        "import sys\nfrom diff4splat.cli.main import run\n"
        f"assert run(['inspect', {scene!r}]) == 0\n"
        "assert run(['paths', 'list']) == 0\n"
        "assert run(['report', 'knobs']) == 0\n"
        "assert 'numba' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_fresh_machine_compiles_for_good(tmp_path: Path) -> None:
    def doctor_says() -> str:
        command = [sys.executable, "-m", "diff4splat.cli.main", "doctor", "--warm"]
        surroundings = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=surroundings)
        return done.stderr

    first = doctor_says()
    assert f"renderer raster: compiled {RASTER.kernel_count()} kernels in" in first
    assert f"worlds: compiled {WORLDS.kernel_count()} kernels in" in first
    assert "renderer trace: compiled" in first
    assert f"hexplane fields: compiled {HEXPLANE.kernel_count()} kernels in" in first
    assert str(tmp_path) in first
    assert doctor_says().count("was already compiled; loaded in") == 4
