"""Knobs of physical cameras: more samples, shorter chunks and later stops come nearer."""

import pytest

from diff4splat.error_time import camera_knobs
from diff4splat.error_time.camera_knobs import TimeSteps, turning_scene
from diff4splat.error_time.knobs import ApproximationSetting


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few Gaussians and few pixels."""
    monkeypatch.setattr(camera_knobs, "GAUSSIANS", 200)
    monkeypatch.setattr(camera_knobs, "SIZE_PX", (24, 32))
    monkeypatch.setattr(camera_knobs, "SMALL_PX", (18, 24))
    monkeypatch.setattr(camera_knobs, "_CONVERGED", 512)


def errors(knob: ApproximationSetting, settings: tuple) -> list[float]:
    exact = knob.run(knob.reference)
    return [knob.error(knob.run(setting), exact) for setting in settings]


@pytest.mark.parametrize("build", [camera_knobs.aperture_knob, camera_knobs.exposure_knob])
def test_more_samples_are_nearer_faster_than_chance_would_be(build) -> None:
    few, some, many = errors(build(), (2, 16, 128))
    assert few > some > many > 0
    # Independent samples would gain a factor of 8.
    assert many < few / 16


def test_shorter_chunks_are_nearer() -> None:
    one, eight, line = errors(
        camera_knobs.chunk_knob(), (TimeSteps(rows=24), TimeSteps(rows=6), TimeSteps(rows=1))
    )
    assert one > eight > line == 0.0


def test_a_tighter_tolerance_is_nearer() -> None:
    loose, tight = errors(
        camera_knobs.chunk_knob(), (TimeSteps(tolerance_px=3.0), TimeSteps(tolerance_px=0.1))
    )
    assert tight < loose


def test_later_stops_are_nearer() -> None:
    early, late = errors(camera_knobs.trace_light_knob(), (0.1, 1e-4))
    assert late <= early
    assert late < 1e-4


def test_the_scene_turns_while_a_frame_is_taken() -> None:
    scene = turning_scene(50)
    first, last = (scene.state_at(at * camera_knobs.FRAME_S).means for at in (-0.5, 0.5))
    assert float((last - first).norm(dim=-1).max()) > 0.1
