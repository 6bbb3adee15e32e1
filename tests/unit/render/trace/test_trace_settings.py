"""What may be set, and what is refused."""

import math

import pytest
import torch

from diff4splat.errors import ConfigError
from diff4splat.render.settings import require_outputs
from diff4splat.render.trace.settings import OUTPUTS, TraceSettings


def test_defaults_draw_gaussians_as_a_rasteriser_does() -> None:
    settings = TraceSettings()
    assert settings.kernel_degree == 2
    assert settings.alpha_cutoff == 1 / 255
    assert (settings.alpha_max, settings.light_cutoff) == (0.99, 1e-4)
    assert settings.min_response is None
    assert settings.color_direction == "ray"


def test_the_preset_is_that_of_3dgrt() -> None:
    settings = TraceSettings.preset_3dgrt()
    assert (settings.kernel_degree, settings.min_response) == (4, 0.0113)
    assert (settings.alpha_cutoff, settings.alpha_max) == (1 / 255, 0.99)
    assert settings.light_cutoff == 1e-3


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("kernel_degree", 3),
        ("alpha_cutoff", 0.0),
        ("alpha_cutoff", 1.0),
        ("alpha_max", 1.0),
        ("alpha_max", 0.001),
        ("light_cutoff", 0.0),
        ("light_cutoff", 1.0),
        ("near_distance", -0.1),
        ("near_distance", math.inf),
        ("min_response", 0.0),
        ("min_response", 1.0),
        ("background", (0.0, math.nan, 0.0)),
        ("background", torch.full((3,), math.inf)),
        ("memory_bytes", 1000),
    ],
)
def test_what_cannot_be_is_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=rf"TraceSettings.{name}: expected .*, got"):
        TraceSettings(**{name: value})


@pytest.mark.usefixtures("as_shipped")
def test_an_unknown_direction_of_colours_is_refused() -> None:
    with pytest.raises(ConfigError, match="color_direction: expected 'ray' or 'mean', got up"):
        TraceSettings(color_direction="up")


@pytest.mark.usefixtures("as_shipped")
def test_outputs_must_be_known_names() -> None:
    assert require_outputs(["rgb", "hits"], OUTPUTS) == {"rgb", "hits"}
    for bad in ("rgb", [], ["rgb", "normal"]):
        with pytest.raises(ConfigError, match="outputs: expected"):
            require_outputs(bad, OUTPUTS)
