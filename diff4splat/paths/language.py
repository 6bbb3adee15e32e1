"""The path language: ``name[:amplitude]`` chained with ``+``, as in ``orbit:0.25+up:0.1``."""

from collections.abc import Sequence
from dataclasses import dataclass

from diff4splat.errors import InputError
from diff4splat.paths.limits import require_amplitude
from diff4splat.paths.messages import quoted, unknown_name
from diff4splat.paths.presets import ALIASES, AMBIGUOUS, PRESETS, Preset

MAX_SEGMENTS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One preset at a definite strength."""

    name: str
    amplitude: float

    @property
    def preset(self) -> Preset:
        """The table row."""
        return PRESETS[self.name]


def parse_path(text: str, amplitude: float | None = None) -> tuple[Segment, ...]:
    """Segments of ``text``; ``amplitude`` goes to those that name none.

    Raises:
        InputError: a name nobody knows, an amplitude that is no number, or nothing at all.
    """
    words = text.lower().replace("_", "-").split("+")
    if len(words) > MAX_SEGMENTS:
        raise InputError(
            f"camera path: expected at most {MAX_SEGMENTS} segments, got {len(words)}; use a file"
        )
    return tuple(_segment(word.strip(), amplitude) for word in words)


def require_short_of_near(segments: Sequence[Segment]) -> None:
    """The camera may come close to the nearest content, but neither reach nor pass it.

    Raises:
        InputError: the segments travel too far towards it.
    """
    travelled = 0.0
    for segment in segments:
        travelled += segment.preset.approach * segment.amplitude
        if travelled >= 1:
            raise InputError(
                f"camera path '{segment.name}:{segment.amplitude:g}': expected less than 1 near "
                f"depth of travel towards the content, got {travelled:g} in all; "
                "choose a smaller amplitude"
            )


def _segment(word: str, shared_amplitude: float | None) -> Segment:
    label, colon, number = (part.strip() for part in word.partition(":"))
    name, sign = _preset_name(label)
    if colon:
        amplitude = _explicit_amplitude(label, name, number)
    elif shared_amplitude is not None:
        amplitude = shared_amplitude
    else:
        amplitude = PRESETS[name].default_amplitude
    return Segment(name=name, amplitude=sign * amplitude)


def _preset_name(label: str) -> tuple[str, int]:
    if label in PRESETS:
        return label, 1
    if label in ALIASES:
        return ALIASES[label]
    if not label:
        raise InputError(
            "camera path: expected a preset name, got nothing; write one, as in orbit:0.25+up"
        )
    first_word = label.partition("-")[0]
    if first_word in AMBIGUOUS:
        raise InputError(
            f"camera path: expected one meaning, but {quoted(label)} has several; "
            f"{AMBIGUOUS[first_word]}"
        )
    raise InputError(unknown_name("camera path", label, PRESETS, ALIASES))


def _explicit_amplitude(label: str, name: str, number: str) -> float:
    if PRESETS[name].unit == "none":
        raise InputError(
            f"camera path: expected no amplitude after '{label}', got {quoted(number)}; "
            "leave it away"
        )
    try:
        amplitude = float(number)
    except ValueError:
        raise InputError(
            f"camera path: expected a number after '{label}:', got {quoted(number)}; "
            f"write for example {label}:{PRESETS[name].default_amplitude:g}"
        ) from None
    require_amplitude(amplitude, f"camera path '{label}'")
    return amplitude
