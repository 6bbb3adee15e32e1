"""``python killed_command.py MOMENT NUMBER ARGUMENTS``: a command that kills itself at a moment.

Moments: before the NUMBER-th update of weights, and half-way through the NUMBER-th weight file of
a model folder.
"""

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from diff4splat.cli.main import run
from diff4splat.models.hub import weights


def dying(function: Callable[..., Any], number: int, last_words: Callable[..., None]) -> Any:
    """``function``, but its call of that number, from 1, is the end of the process."""
    calls = []

    def deadly(*args: Any, **options: Any) -> Any:
        calls.append(args)
        if len(calls) == number:
            last_words(*args)
            os.kill(os.getpid(), signal.SIGKILL)
        return function(*args, **options)

    return deadly


def nothing(*_: Any) -> None:
    """Die at once."""


def half_the_weights(_: Any, file: Path) -> None:
    """Die with the weights begun."""
    file.write_bytes(b"half")


def main() -> None:
    moment, number, *arguments = sys.argv[1:]
    if moment == "update":
        torch.optim.AdamW.step = dying(torch.optim.AdamW.step, int(number), nothing)
    elif moment == "hand-over":
        weights._save_readable = dying(weights._save_readable, int(number), half_the_weights)
    sys.exit(run(arguments))


if __name__ == "__main__":
    main()
