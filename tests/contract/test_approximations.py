"""Every field of a settings class is an approximation that is measured, or a user's choice."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from diff4splat.error_time.declared import DECLARING, SUBJECTS, declarations
from diff4splat.error_time.known_knobs import known_knobs

ROOT = Path(__file__).parents[2]
PACKAGES = ("diff4splat", "models", "training", "data_prep", "configs")
CLASS = re.compile(r"^class (\w+Settings)\b", re.MULTILINE)
CLASSES = {cls.__name__: cls for module in DECLARING for cls in module.SETTINGS_CLASSES}
CHOICES = {name: why for module in DECLARING for name, why in module.USER_CHOICES.items()}
ELSEWHERE = {
    "AlignmentSettings": "preparation of training data",
    "DataSettings": "a recipe of training: decides which weights come out",
    "DrawSettings": "ground truth of drawn worlds",
    "ExportSettings": "which files an export writes",
    "OptimizerSettings": "a recipe of training",
    "PipelineSettings": "preparation of training data",
    "PathSettings": "where cameras go: what is asked for",
    "RasterSettings": "`RenderSettings` as kernels read them",
    "RunSettings": "where and how long a training runs",
    "SampleSettings": "preparation of training data",
    "ServerSettings": "limits of the server",
    "SourceSettings": "a recipe of training",
    "TrainerSettings": "a recipe of training",
}
"""Settings classes that decide about no result of a given model, image and path."""


def measured_fields() -> set[str]:
    return {field for knob in known_knobs() for field in knob.fields}


def settings_classes() -> set[str]:
    """Names of all classes that end in ``Settings``, from the source."""
    files = {path.resolve() for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    return {name for path in files for name in CLASS.findall(path.read_text())}


def test_every_settings_class_is_known() -> None:
    known, found = {*CLASSES, *ELSEWHERE}, settings_classes()
    assert found <= known, "declare it in the `approximations` module of its package"
    assert set(ELSEWHERE) <= found


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_every_field_is_measured_or_a_choice_with_a_reason(name: str) -> None:
    for field in fields(CLASSES[name]):
        full = f"{name}.{field.name}"
        assert (full in measured_fields()) != (full in CHOICES), (
            f"{full}: expected an approximation that covers it, or a reason in USER_CHOICES"
        )


def test_every_name_that_is_declared_exists() -> None:
    existing = {f"{name}.{field.name}" for name, cls in CLASSES.items() for field in fields(cls)}
    declared = {field for one in declarations() for field in one.fields}
    assert {*declared, *CHOICES} <= existing
    assert all(len(why) > 10 for why in CHOICES.values())


@pytest.mark.parametrize("one", declarations(), ids=lambda one: one.name)
def test_every_value_makes_settings_that_are_accepted(one) -> None:
    base = SUBJECTS[one.subject].base
    for value in (*one.values, one.reference):
        assert type(one.apply(base, value)) is type(base)
    assert one.apply(base, one.default) == one.apply(one.apply(base, one.values[0]), one.default)
