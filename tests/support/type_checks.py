"""Types and shapes of arguments and results are checked in the first calls of every function.

Checking every call took as long as everything else that the tests do.
"""

import functools
import inspect
from collections.abc import Callable

import jaxtyping
import torch
from beartype import beartype
from jaxtyping import _decorator

CHECKED_CALLS = 30
"""Of every function, in every process."""

check_types = beartype
check_every_call = _decorator.jaxtyped


def install() -> None:
    """Before the package is imported."""
    jaxtyping.jaxtyped = _decorator.jaxtyped = check_first_calls


def check_first_calls(function: Callable | None = None, *, typechecker: Callable) -> Callable:
    """In place of ``jaxtyping.jaxtyped``, for functions, methods and the rest that it takes.

    What is never called costs nothing. Functions inside functions, which every call of the outer
    one defines again, are left alone.
    """
    if function is None:
        return functools.partial(check_first_calls, typechecker=typechecker)
    if not inspect.isfunction(function):
        return check_every_call(function, typechecker=typechecker)
    if "<locals>" in function.__qualname__:
        return function
    checked = functools.cache(lambda: check_every_call(function, typechecker=typechecker))
    calls = 0

    @functools.wraps(function)
    def checking(*args: object, **kwargs: object) -> object:
        nonlocal calls
        if calls >= CHECKED_CALLS or torch.compiler.is_compiling():
            return function(*args, **kwargs)
        calls += 1
        return checked()(*args, **kwargs)

    return checking
