import pytest

from diff4splat.errors import ConfigError
from diff4splat.render.settings import RenderSettings, require_outputs


@pytest.mark.parametrize(
    ("setting", "value", "expected"),
    [
        ("background", (0.0, 0.0, float("nan")), "three finite numbers"),
        ("dilation_px2", -0.1, "at least 0"),
        ("dilation_px2", float("nan"), "at least 0"),
        ("dilation_px2", float("inf"), "finite"),
        ("alpha_cutoff", 0.0, "above 0 and below 1"),
        ("alpha_max", 1.0, "above alpha_cutoff and below 1"),
        ("alpha_max", 0.001, "above alpha_cutoff and below 1"),
        ("near_depth", 0.0, "above 0"),
        ("tile_px", 0, "at least 1"),
        ("memory_bytes", 1000, "at least 1048576"),
    ],
)
def test_a_wrong_setting_is_named(setting: str, value: object, expected: str) -> None:
    with pytest.raises(ConfigError, match=rf"RenderSettings\.{setting}: expected .*{expected}"):
        RenderSettings(**{setting: value})


def test_the_defaults_are_fine() -> None:
    assert RenderSettings() == RenderSettings(background=(0.0, 0.0, 0.0), dilation_px2=None)
    assert RenderSettings().added_px2 == 0.3
    assert RenderSettings(dilation_px2=0.0).added_px2 == 0.0


def test_outputs_come_back_as_a_set() -> None:
    assert require_outputs(["rgb", "alpha", "rgb"]) == {"rgb", "alpha"}


@pytest.mark.parametrize("outputs", [(), ("rgb", "normals"), "rgb"])
def test_unknown_outputs_are_answered_with_the_known(outputs: object) -> None:
    with pytest.raises(
        ConfigError, match="among rgb, depth, median_depth, alpha, flow, features, got"
    ):
        require_outputs(outputs)
