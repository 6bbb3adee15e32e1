"""The shipped knobs: their references are trustworthy and their errors fall."""

import json
from dataclasses import replace

import pytest
import torch

from diff4splat.error_time import flow_knobs, scene_knobs
from diff4splat.error_time.flow_knobs import (
    DEFAULT,
    REFERENCE,
    SamplerSetting,
    median_relative_error,
)
from diff4splat.error_time.knobs import KnobRegistry
from diff4splat.error_time.known_knobs import known_knobs, register_known_knobs
from diff4splat.error_time.sweep import sweep
from diff4splat.error_time.tables import to_json
from diff4splat.progress.machine import this_machine


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few trajectories and few pixels."""
    monkeypatch.setattr(flow_knobs, "TRAJECTORIES", 16)
    monkeypatch.setattr(scene_knobs, "SIZE_PX", (12, 16))


def test_names_are_unique_and_registration_is_explicit() -> None:
    registry = KnobRegistry()
    register_known_knobs(registry)
    names = [knob.name for knob in registry.knobs()]
    assert names == [knob.name for knob in known_knobs()]
    assert {"sampler", "levels", "pruning"} <= set(names)


def test_every_setting_has_its_own_name() -> None:
    for knob in known_knobs():
        assert len({str(setting) for setting in knob.settings}) == len(knob.settings)
        assert all("object at" not in str(setting) for setting in knob.settings)


def test_the_reference_solution_is_exact_enough() -> None:
    """Even with guidance, half the steps change it by far less than any setting is off."""
    run = flow_knobs.guided_sampler_knob().run
    coarse = replace(REFERENCE, steps=REFERENCE.steps // 4)
    finer = replace(REFERENCE, steps=REFERENCE.steps // 2)
    assert median_relative_error(run(coarse), run(finer)) < 1e-5


def test_more_calls_mean_less_error() -> None:
    knob = flow_knobs.sampler_knob()
    reference = knob.run(replace(REFERENCE, steps=300))
    for name in ("euler", "midpoint", "heun", "multistep2"):
        settings = [setting for setting in knob.settings if setting.sampler == name]
        errors = [knob.error(knob.run(setting), reference) for setting in settings]
        assert errors == sorted(errors, reverse=True)
        assert knob.series(settings[0]) == name


def test_the_default_levels_are_the_best_at_equal_calls() -> None:
    knob = flow_knobs.levels_knob()
    reference = knob.run(replace(REFERENCE, steps=300))
    errors = {
        setting: knob.error(knob.run(setting), reference)
        for setting in knob.settings
        if setting.calls == DEFAULT.calls
    }
    assert len(errors) == 4
    assert min(errors, key=errors.get) == DEFAULT


def test_guidance_everywhere_is_the_reference() -> None:
    knob = flow_knobs.guidance_knob()
    reference = knob.run(knob.reference)
    errors = [knob.error(knob.run(setting), reference) for setting in knob.settings]
    assert errors[0] == 0
    # Below level 0.2 guidance does nothing to these flows.
    shortened = [e for e, s in zip(errors, knob.settings, strict=True) if s.high < 1]
    assert min(shortened) > 1e-3


def test_a_sampler_setting_says_what_it_costs() -> None:
    setting = SamplerSetting(sampler="heun", steps=4, schedule="uniform", shift=3.0)
    assert (setting.calls, str(setting)) == (7, "heun uniform shift 3 4")


def test_median_relative_error_ignores_one_stray_trajectory() -> None:
    reference = torch.ones(5, 3)
    result = 1.1 * reference
    result[0] = 1e6
    assert median_relative_error(result, reference) == pytest.approx(0.1, rel=1e-5)


def test_pruning_and_harmonics_errors_grow_with_what_is_left_out() -> None:
    cloud = scene_knobs.random_gaussians(count=300)
    whole = scene_knobs.image(cloud)
    assert whole.shape == (12, 16, 3)
    pruned = [scene_knobs.prune_gaussians(cloud, opacity) for opacity in (0.0, 0.05, 0.5, 1.0)]
    errors = [scene_knobs.rmse(scene_knobs.image(part), whole) for part in pruned]
    assert errors[0] == 0
    assert errors == sorted(errors)
    cut = [scene_knobs.truncate_harmonics(cloud, degree) for degree in (3, 2, 1, 0)]
    errors = [scene_knobs.rmse(scene_knobs.image(part), whole) for part in cut]
    assert errors[0] == 0
    assert errors == sorted(errors)


def test_rmse() -> None:
    assert scene_knobs.rmse(torch.tensor([3.0, 0.0]), torch.tensor([0.0, 4.0])) == pytest.approx(
        12.5**0.5
    )


def test_scene_knobs_sweep_to_valid_json() -> None:
    results = [sweep(scene_knobs.pruning_knob(), 1), sweep(scene_knobs.harmonics_knob(), 1)]
    assert [result.default.error == 0 for result in results] == [False, True]
    assert len(json.loads(to_json(results, this_machine()))["knobs"]) == 2
