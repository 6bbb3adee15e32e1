"""A user's models in the stages: named as ``module:function``, loaded where they are used.

A quality model takes RGB frames (t, h, w, 3) uint8 and returns one number; a captioning model takes
a clip and returns text. The function may be in any module that Python finds, the present folder
included; nothing is imported that the user did not name.
"""

import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff4splat.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class Hooks:
    """Names of the user's models; empty is none."""

    quality: str = ""


NO_HOOKS = Hooks()


def load_hook(name: str) -> Callable[..., Any]:
    """The function that ``module:function`` names.

    Raises:
        ConfigError: another form, no such module, or no such function in it.
    """
    module_name, colon, function_name = name.partition(":")
    if not (module_name and colon and function_name):
        raise ConfigError(f"hook: expected module:function, got {name!r}")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # a module of the user's may raise anything while it is loaded
        raise ConfigError(
            f"hook {name}: expected a module '{module_name}', got {type(error).__name__}: {error}; "
            "run in its folder, or put that on PYTHONPATH"
        ) from error
    function = getattr(module, function_name, None)
    if not callable(function):
        raise ConfigError(f"hook {name}: expected a function '{function_name}', got none of it")
    return function
