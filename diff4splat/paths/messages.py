"""Error messages about unknown names."""

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST_QUOTE = 40


def quoted(value: object) -> str:
    """``value`` for a one-line message: escaped and shortened."""
    text = repr(value)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[:_LONGEST_QUOTE]}..."


def unknown_name(what: str, got: str, known: Iterable[str], also: Iterable[str] = ()) -> str:
    """``what: expected one of known; got ...``, with the closest name as advice."""
    names = list(known)
    nearest = get_close_matches(got, [*names, *also], n=1, cutoff=0.5)
    advice = f"did you mean '{nearest[0]}'?" if nearest else "choose one of these"
    return f"{what}: expected one of {', '.join(names)}; got {quoted(got)}; {advice}"
