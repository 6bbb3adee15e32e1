import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import Diff4SplatError, InputError
from diff4splat.paths.language import parse_path
from diff4splat.paths.presets import PRESETS


def _parsed(text: str, amplitude: float | None = None) -> list[tuple[str, float]]:
    return [(segment.name, segment.amplitude) for segment in parse_path(text, amplitude)]


@pytest.mark.parametrize(
    ("text", "segments"),
    [
        ("spiral", [("spiral", 0.15)]),
        ("orbit:0.25+up:0.1", [("orbit", 0.25), ("up", 0.1)]),
        (" Orbit : 0.25 + UP ", [("orbit", 0.25), ("up", 0.15)]),
        ("dolly_zoom:-.3", [("dolly-zoom", -0.3)]),
        ("dolly-in+swipe-left:0.2", [("forward", 0.25), ("left", 0.2)]),
        ("roll-ccw:0.2", [("roll", -0.2)]),
        ("roll-ccw", [("roll", -0.1)]),
        ("orbit:2.5e-1", [("orbit", 0.25)]),
        ("up:0", [("up", 0.0)]),
    ],
)
def test_segments(text: str, segments: list[tuple[str, float]]) -> None:
    assert _parsed(text) == segments


def test_a_shared_amplitude_fills_the_gaps() -> None:
    assert _parsed("up+orbit:0.5+roll-ccw", 0.3) == [("up", 0.3), ("orbit", 0.5), ("roll", -0.3)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "spirall",
            "expected one of static, orbit, .*figure8; got 'spirall'; did you mean 'spiral'",
        ),
        ("dollyin", "did you mean 'dolly-in'"),
        ("xyzzy", "choose one of these"),
        ("", "expected a preset name, got nothing"),
        ("up++down", "expected a preset name, got nothing"),
        (":0.5", "expected a preset name, got nothing"),
        ("up:", "expected a number after 'up:', got ''; write for example up:0.15"),
        ("up:high", "expected a number after 'up:', got 'high'"),
        ("up:0.1:0.2", "expected a number after 'up:', got '0.1:0.2'"),
        ("up:nan", "expected an amplitude from -100 to 100, got nan"),
        ("up:inf", "got inf"),
        ("up:1e9", "got 1e"),
        ("static:0.5", "expected no amplitude after 'static', got '0.5'"),
        ("pan-left", "expected one meaning, but 'pan-left' has several; write left or right"),
        ("zoom", "dolly-zoom"),
        ("+".join(["up"] * 101), "expected at most 100 segments, got 101"),
    ],
)
def test_what_is_not_understood_is_explained(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_path(text)


@settings(max_examples=50, deadline=None)
@given(st.text(max_size=60) | st.from_regex(r"[a-z+:0-9.\n-]{0,40}", fullmatch=True))
def test_any_text_is_parsed_or_refused_in_one_short_line(text: str) -> None:
    try:
        segments = parse_path(text)
    except Diff4SplatError as error:
        assert "\n" not in str(error)
        assert len(str(error)) < 400
    else:
        assert {segment.name for segment in segments} <= set(PRESETS)
