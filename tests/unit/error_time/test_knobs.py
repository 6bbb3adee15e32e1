import pytest
import torch

from diff4splat.error_time.knobs import ApproximationSetting, KnobRegistry
from diff4splat.errors import ConfigError


def knob(name: str = "digits", **changes: object) -> ApproximationSetting:
    values: dict[str, object] = {
        "name": name,
        "summary": "rounding pi",
        "error_unit": "absolute error",
        "settings": (0, 2, 4),
        "default": 2,
        "reference": 15,
        "run": lambda digits: torch.tensor(round(torch.pi, digits), dtype=torch.float64),
        "error": lambda result, reference: float((result - reference).abs()),
    }
    return ApproximationSetting(**{**values, **changes})


def test_keeps_registration_order() -> None:
    registry = KnobRegistry()
    for name in ("b", "a", "c-2"):
        registry.register(knob(name))
    assert [k.name for k in registry.knobs()] == ["b", "a", "c-2"]
    assert [k.name for k in registry.knobs(("c-2", "b"))] == ["c-2", "b"]


def test_registries_are_independent() -> None:
    first = KnobRegistry()
    first.register(knob())
    assert KnobRegistry().knobs() == ()


def test_refuses_a_name_that_is_taken() -> None:
    registry = KnobRegistry()
    registry.register(knob())
    with pytest.raises(ConfigError, match="expected a new name, got one that is taken"):
        registry.register(knob())


def test_refuses_a_name_that_nobody_registered() -> None:
    registry = KnobRegistry()
    registry.register(knob())
    with pytest.raises(ConfigError, match=r"knob: expected one of digits; got 'digit'; did you"):
        registry.knobs(("digit",))


@pytest.mark.parametrize("name", ["", "Digits", "two words", "-a", "a/b"])
def test_refuses_a_name_that_is_no_file_name(name: str) -> None:
    with pytest.raises(ConfigError, match="knob name: expected lower-case letters"):
        knob(name)


def test_refuses_settings_that_make_no_table() -> None:
    with pytest.raises(ConfigError, match="at least one setting, each only once"):
        knob(settings=())
    with pytest.raises(ConfigError, match="at least one setting, each only once"):
        knob(settings=(2, 2))
    with pytest.raises(ConfigError, match="expected the default among its settings, got 3"):
        knob(default=3)
