"""What became of one damaged example."""

import traceback
from collections.abc import Iterator
from dataclasses import dataclass

from diff4splat.errors import Diff4SplatError

OK, REFUSED, FOREIGN, HANG, MEMORY = "ok", "refused", "foreign", "hang", "memory"
FAILURES = (FOREIGN, HANG, MEMORY)
_ALLOCATION = ("allocate memory", "Insufficient memory", "cannot allocate", "bad_alloc")


@dataclass(frozen=True, slots=True)
class Outcome:
    """One of the five, and for failures what happened where."""

    kind: str
    where: str = ""
    """The same for failures of one cause."""
    message: str = ""


def outcome_of(error: BaseException) -> Outcome:
    """A refusal, or a failure: even an error of ours is one if memory ran out before it."""
    chain = list(_chain(error))
    for cause in chain:
        if _is_memory(cause):
            return Outcome(MEMORY, _place(cause), _text(cause))
    if isinstance(error, Diff4SplatError):
        return Outcome(REFUSED)
    return Outcome(FOREIGN, f"{type(error).__name__} at {_place(error)}", _text(error))


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _is_memory(error: BaseException) -> bool:
    if isinstance(error, MemoryError):
        return True
    return isinstance(error, Exception) and any(word in str(error) for word in _ALLOCATION)


def _place(error: BaseException) -> str:
    """The innermost line of ours."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "site-packages" not in frame.filename]
    ours = [frame for frame in ours if "fuzz" not in frame.filename] or frames
    return f"{'/'.join(ours[-1].filename.split('/')[-2:])}:{ours[-1].lineno}" if ours else "?"


def _text(error: BaseException) -> str:
    return f"{type(error).__name__}: {str(error)[:200]}"
