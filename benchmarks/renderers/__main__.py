"""Renderers side by side on the CPU: milliseconds, ratios and memory, each image checked.

Run ``python benchmarks/renderers --help``. Nothing else should compute meanwhile.
"""

import os
import signal
import sys

# Read once, when torch is loaded: threads that wait must sleep.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import tyro
from commands import compare, find_slope, list_all
from options import Options

from diff4splat.errors import Diff4SplatError

BAD_INPUT, INTERRUPTED, TERMINATED = 2, 130, 143


def main() -> int:
    """The exit code; 2 after one line about what was asked for."""
    # Ended from outside, the workers must end too.
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda *_: sys.exit(TERMINATED))
    try:
        options = tyro.cli(Options, prog="renderers", config=(tyro.conf.FlagCreatePairsOff,))
        work = list_all if options.list else find_slope if options.slope else compare
        sys.stdout.write(work(options))
    except Diff4SplatError as error:
        sys.stderr.write(f"renderers: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
