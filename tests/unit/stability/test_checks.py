"""What checks measure: that they see errors, run in a quick subset, and know what is refused."""

from dataclasses import replace

import pytest
import torch

from diff4splat.flow import samplers
from diff4splat.geometry.camera import pinhole
from diff4splat.render.raster import backend as raster
from diff4splat.stability.check import Check
from diff4splat.stability.checks.camera_checks import camera_checks
from diff4splat.stability.checks.depth_checks import depth_checks
from diff4splat.stability.checks.gaussian_checks import gaussian_checks
from diff4splat.stability.checks.image_checks import image_checks
from diff4splat.stability.checks.loss_checks import loss_checks
from diff4splat.stability.checks.motion_checks import motion_checks
from diff4splat.stability.checks.network_checks import network_checks
from diff4splat.stability.checks.sampler_checks import measure_sampler
from diff4splat.stability.checks.vae_checks import vae_checks
from diff4splat.stability.compare import all_finite, finite_gradients, relative_error, rms_error
from diff4splat.stability.known_checks import known_checks
from diff4splat.stability.runner import run_check
from diff4splat.stability.subjects.casting import CastNetwork, cast
from diff4splat.stability.subjects.sampler_fields import end_points, exact_end_points

F64 = torch.float64


def named(checks: object, name: str) -> Check:
    return next(check for check in checks if check.name == name)


def test_errors_are_relative_and_infinite_where_not_finite() -> None:
    exact = torch.tensor([1.0, -4.0], dtype=F64)
    assert relative_error(torch.tensor([1.0, -3.0]), exact) == 0.25
    assert relative_error(torch.tensor([1.0, torch.nan]), exact) == torch.inf
    assert relative_error(torch.zeros(3), exact) == torch.inf
    assert rms_error(torch.tensor([1.0, -2.0]), exact) == pytest.approx(2**0.5)
    assert relative_error(torch.zeros(0), torch.zeros(0)) == 0


def test_gradients_that_are_not_finite_are_seen() -> None:
    leaf = torch.zeros(3, requires_grad=True)
    assert finite_gradients([leaf.sqrt()], {"leaf": leaf}) is False
    assert finite_gradients([leaf.exp()], {"leaf": leaf}) is True
    assert finite_gradients([torch.ones(2)], {"leaf": leaf}) is None


def test_the_reference_of_samplers_has_converged() -> None:
    exact = exact_end_points(1.0, (1.0, 30.0))
    for sampler, index, weight in (("midpoint", 0, 1.0), ("multistep2", 1, 30.0)):
        ends = end_points(sampler, 400, 1.0, weight)
        assert relative_error(ends, exact[index]) < 1e-3


def test_a_sampler_that_goes_wrong_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    euler = samplers.SAMPLERS["euler"]

    def wrong(velocity, state, pair, memory):
        moved, memory = euler.step(velocity, state, pair, memory)
        return 1.1 * moved, memory

    fine = measure_sampler("euler", 1e-6)
    monkeypatch.setitem(samplers.SAMPLERS, "euler", replace(euler, step=wrong))
    broken = measure_sampler("euler", 1e-6)
    assert fine.error < 1e-6 and broken.error > 0.05
    assert "no number of steps" in broken.note


def test_the_rasteriser_going_wrong_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    check = named(gaussian_checks(), "opacity 1, rasterised")
    assert run_check(check).verdict == "ok"
    render = raster.render
    monkeypatch.setattr(raster, "render", lambda job: replace(render(job), rgb=0 * render(job).rgb))
    assert run_check(check).verdict == "fails"


@pytest.mark.parametrize(
    "name, words",
    [
        ("field of view 0.5°", "1 to 170"),
        ("field of view 175°", "1 to 170"),
        ("camera path forward:1", "smaller amplitude"),
    ],
)
def test_what_cannot_be_is_refused_by_name(name: str, words: str) -> None:
    record = run_check(named(camera_checks(), name))
    assert record.verdict == "refused" and words in record.note


def test_refused_images_are_named_without_a_folder() -> None:
    for name in ("1:40", "one pixel"):
        record = run_check(named(image_checks("small"), name))
        assert record.verdict == "refused" and "/tmp" not in record.note


@pytest.mark.parametrize("checks", [loss_checks, motion_checks, camera_checks])
def test_the_quick_checks_of_cheap_groups_are_ok(checks) -> None:
    for check in checks():
        if check.quick:
            assert run_check(check).verdict in ("ok", "refused"), check.name


def test_fused_depth_is_finite_and_exact_for_all_maps() -> None:
    for check in depth_checks():
        assert run_check(check).verdict == "ok", check.name


def test_a_network_in_every_precision() -> None:
    for dtype in ("float32", "bfloat16", "float16"):
        record = run_check(named(network_checks("small"), f"text_encoder, {dtype}"))
        assert record.verdict == "ok" and record.outcome.gradient_finite
    chunks = named(
        vae_checks("small"), "chunks of seven latent frames against single ones, float64"
    )
    assert run_check(chunks).verdict == "ok"


def test_cameras_do_not_follow_networks_into_half_precision() -> None:
    camera = pinhole(10.0, (4, 4))
    values = cast([camera, torch.ones(2), torch.arange(2)], torch.float16)
    assert values[0].focal_px.dtype == torch.float32
    assert [value.dtype for value in values[1:]] == [torch.float16, torch.int64]
    assert cast(camera, F64).focal_px.dtype == F64


def test_a_cast_network_takes_and_returns_float32() -> None:
    network = CastNetwork(torch.nn.Linear(2, 2), torch.bfloat16)
    output = network(torch.ones(1, 2))
    assert output.dtype == torch.float32 and all_finite([output])
    assert network.weight.dtype == torch.bfloat16


def test_names_are_unique_and_the_quick_subset_has_every_slow_group_but_few() -> None:
    checks = known_checks()
    names = [(check.group, check.name) for check in checks]
    assert len(set(names)) == len(names)
    quick = known_checks(quick=True)
    assert set(quick) < set(checks) or len(quick) < len(checks)
    assert {"samplers", "networks", "cameras", "gaussians", "images"} <= {c.group for c in quick}
