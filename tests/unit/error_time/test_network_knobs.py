"""Precisions that compute, scene files and key frames."""

import pytest
import torch
from torch import nn

from diff4splat.error_time.known_knobs import known_knobs
from diff4splat.error_time.scene_knobs import rmse
from diff4splat.error_time.subjects import files
from diff4splat.error_time.subjects.networks import compute_in


def network() -> nn.Sequential:
    torch.manual_seed(0)
    return nn.Sequential(
        nn.Conv2d(3, 8, 3), nn.GELU(), nn.Flatten(), nn.Linear(8 * 36, 16), nn.LayerNorm(16)
    )


@pytest.mark.parametrize(
    ("precision", "least", "most"),
    [("bfloat16", 1e-4, 3e-2), ("float16", 1e-6, 4e-3), ("int8", 1e-4, 5e-2)],
)
def test_products_are_computed_in_the_precision(precision: str, least: float, most: float) -> None:
    image = torch.randn(2, 3, 8, 8, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        exact, changed = network()(image), network()
        compute_in(changed, precision)
        seen = changed(image)
    assert seen.dtype == torch.float32
    assert least < float((seen - exact).square().mean().sqrt()) < most


def test_what_is_no_matrix_product_stays_float32() -> None:
    changed = network()
    compute_in(changed, "bfloat16")
    assert changed[3].weight.dtype == torch.bfloat16
    assert changed[4].weight.dtype == torch.float32


def test_closer_keys_show_the_motion_better(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "GAUSSIANS", 150)
    monkeypatch.setattr(files, "TIMES", 3)
    monkeypatch.setattr(files, "SIZE_PX", (24, 32))
    with torch.no_grad():
        true = files.baked(None)
        errors = [rmse(files.baked(tolerance), true) for tolerance in (5.0, 0.5, 0.02)]
    assert errors[0] > errors[1] > errors[2] > 0
    assert errors[2] < 1e-3


def test_the_new_settings_are_in_the_report() -> None:
    names = {knob.name: knob for knob in known_knobs()}
    assert {"scene-compression", "bake-tolerance"} <= set(names)
    assert "bfloat16 computed" in names["precision-dit"].settings
