"""The type checker that tests put on the functions of the package."""

from collections.abc import Callable

from beartype import beartype


def check_types(function: Callable) -> Callable:
    """Beartype, except for functions defined inside functions.

    Every call of the outer function defines those again, and beartype then compiles a wrapper
    again: this took longer than the image that the renderer drew.
    """
    return function if "<locals>" in function.__qualname__ else beartype(function)
