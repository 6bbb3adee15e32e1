"""Work of commands, counted from options and headers, against counts by hand."""

from dataclasses import replace
from pathlib import Path

import coded_scenes
import pytest
import torch
from small_fits import ball_capture

from diff4splat.cli.common.parser import parse
from diff4splat.cli.limits import baking, fitting, looking, rendering, tracing, training
from diff4splat.cli.limits.costing import Costing, Promise
from diff4splat.cli.limits.scene_header import SceneHeader, read_scene_header
from diff4splat.errors import ConfigError
from diff4splat.fitting.settings import DensitySettings, FitSettings
from diff4splat.io.scene_files.scene_file import save_scene
from diff4splat.outputs.budgets.costs import FREE_CORES, CostRates, Forecast, free_cores
from diff4splat.outputs.budgets.limits import Limits, loss_from_error
from diff4splat.outputs.budgets.table import find_table
from diff4splat.scene.motion.hexplane.planes import PLANE_NAMES


@pytest.mark.parametrize("compression", ["lossless", "standard"])
@pytest.mark.parametrize("kind", ["static", "keyframes", "spacetime", "hexplane"])
def test_headers_of_plain_and_coded_files_count_alike(
    kind: str, compression: str, tmp_path: Path
) -> None:
    scene = coded_scenes.scene(kind)
    save_scene(scene, tmp_path / "s.safetensors", compression)
    header = read_scene_header(tmp_path / "s.safetensors")
    nodes = 0
    if kind == "keyframes":
        nodes = len(scene.motion.key_times_s)
    if kind == "hexplane":
        nodes = max(len(level[PLANE_NAMES.index("xt")]) for level in scene.motion.planes.levels)
    poses = scene.path.cameras.world_from_camera.flatten(1)
    assert header == SceneHeader(
        gaussians=len(scene.gaussians),
        moving=len(scene.motion.moving_index),
        bases=scene.gaussians.sh.shape[1],
        frames=len(scene.path),
        views=len(poses.unique(dim=0)),
        size_px=tuple(scene.path.cameras.size_px),
        motion=kind,
        time_nodes=nodes,
    )


def test_a_larger_tolerance_needs_fewer_keys_of_a_field() -> None:
    header = SceneHeader(moving=10, views=2, motion="hexplane", time_nodes=25)
    keys = [baking.expected_keys(header, px) for px in (1e-9, 0.1, 0.4, 1e9)]
    assert keys == [75, 25, 12.5, 2]
    assert baking.probe_count(header, 25) == 3 * (32 + 25) + 5 * 24
    own = replace(header, motion="keyframes", time_nodes=9)
    assert baking.expected_keys(own, 0.1) == baking.expected_keys(own, 2.0) == 9


def test_gaussians_of_a_stage_grow_as_its_splits_allow() -> None:
    density = DensitySettings(budget=250, every=100, growth=0.5, until=0.6)
    count, summed = 100.0, 0.0
    for step in range(1, 1001):
        summed += count
        if step % 100 == 0 and 300 <= step <= 600:
            count = min(250, count * 1.5 + 1)
    grown = fitting.grow(100, 1000, density)
    assert grown.last == count == 250
    assert grown.summed == pytest.approx(summed)
    assert fitting.grow(400, 1000, density).last == 400
    assert fitting.grow(100, 0, density).summed == 0


@pytest.mark.parametrize(
    ("motion", "steps"),
    [("static", (150, None)), ("hexplane", (50, 100)), ("spacetime", (50, 100))],
)
def test_steps_of_a_fit_are_counted_by_stage(motion: str, steps: tuple[int, int | None]) -> None:
    settings = FitSettings(motion=motion, coarse_steps=50, fine_steps=100)
    counted = fitting.work(settings, ball_capture(), 10, settings.coarse_steps)
    assert counted["fit_steps static"] == steps[0]
    assert counted.get(f"fit_steps {motion}" if steps[1] else "none") == steps[1]
    assert counted["fitted_gaussians"] == 150 * 10 * settings.views_per_step


def test_work_of_an_export_follows_what_it_does() -> None:
    full, plain, shapes = (
        tracing.request_work(parse(["export", "onnx", "--model", "test", *rest, "--out", "x"]))
        for rest in ((), ("--skip-parity",), ("--shapes-only",))
    )
    assert full["checked_layers"] == full["traced_layers"] == shapes["traced_layers"] > 0
    assert plain["checked_layers"] == 0 == shapes["optimized_layers"] == shapes["stored_weights"]


@pytest.fixture
def costing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Costing:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    rates = CostRates(seconds={"start": 2.0}, memory_bytes={"start": 5e8})
    table = replace(find_table(), speed_s=1.0, rates={"train": rates, "render": rates})
    monkeypatch.setattr("diff4splat.cli.limits.costing.measure_speed_s", lambda: 1.0)
    monkeypatch.setattr(Costing, "of", classmethod(lambda cls, file=None: cls(table)))
    return Costing(table)


def test_work_that_nobody_measured_is_refused_by_name(costing: Costing) -> None:
    costing.require_known("train", {"start": 1, "steps other": 0})
    with pytest.raises(ConfigError, match=r"measured \(start\), got steps a b; .*calibrate"):
        costing.require_known("train", {"start": 1, "steps a b": 5})
    with pytest.raises(ConfigError, match="expected rates of fit, got those of render, train"):
        costing.require_known("fit", {"start": 1})
    stage = parse(["train", "--config", "test", "--stage", "vae", "--out", "x"])
    assert training.promise(stage) is None


def test_a_machine_that_is_too_different(
    costing: Costing, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Limits are refused; a command without any runs, and says no forecast that means nothing."""
    monkeypatch.setattr("diff4splat.cli.limits.costing.measure_speed_s", lambda: 50.0)
    save_scene(coded_scenes.scene("static"), tmp_path / "s.safetensors")
    command = ["render", str(tmp_path / "s.safetensors"), "--out", "x.webm"]
    assert rendering.promise(parse(command)).lines() == []
    with pytest.raises(ConfigError, match=r"at most 8 times as fast or slow as .*report calibrate"):
        rendering.promise(parse([*command, "--budget", "1h"]))


def test_long_work_is_said_before_and_compared_after() -> None:
    expected = Forecast(seconds=60.0, cpu_seconds=70.0, memory_bytes=1e9)
    promised = Promise(limits=Limits(), expected=expected)
    assert promised.lines() == [
        "forecast: about 60 s (70 s of processor time) and 1.0 GB of memory"
    ]
    measured = {"seconds": 50.0, "cpu_seconds": 55.0, "memory_bytes": 9e8}
    assert promised.after(measured) == ["measured: 50 s (55 s of processor time), 0.9 GB"]
    short = replace(promised, expected=replace(expected, seconds=1.0))
    assert short.lines() == short.after(measured) == []


def test_cores_can_be_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FREE_CORES, "1.5")
    assert free_cores() == 1.5
    for text in ("many", "0", "-1", "nan", "1e9"):
        monkeypatch.setenv(FREE_CORES, text)
        with pytest.raises(ConfigError, match=f"{FREE_CORES}: expected a number of cores"):
            free_cores()


def test_a_tolerance_of_render_looks_at_the_scene(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """What the middle frame loses decides, not the table alone."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("diff4splat.cli.limits.costing.measure_speed_s", lambda: 0.006)
    scene = coded_scenes.scene("static")
    cameras = scene.path.cameras[torch.zeros(8, dtype=torch.long)]
    path = replace(scene.path, cameras=cameras, times_s=torch.linspace(0, 1, 8))
    save_scene(replace(scene, path=path), tmp_path / "s.safetensors")
    words = ["render", str(tmp_path / "s.safetensors"), "--out", "x.webm", "--tolerance"]
    errors = looking.looked_errors(parse([*words, "1dB"]))
    assert 0 < errors[0.75, 1 / 255] < errors[0.5, 1 / 255]
    assert errors[1.0, 1 / 64] < errors[1.0, 1 / 16]
    losses = (loss_from_error(1.3 * (errors[0.75, 1 / 255] + errors[1.0, 1 / 16])), 1e-3)
    shares = [
        rendering.promise(parse([*words, f"{loss:.6f}dB"])).choice.values["side_share"]
        for loss in losses
    ]
    assert shares[0] < shares[1] == 1.0
