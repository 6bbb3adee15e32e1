"""``diff4splat doctor``: versions, back ends and extras of this installation, and a self-test.

The table is printed line by line, so that a crash still leaves the lines before it.
"""

import os
import platform
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from diff4splat.cli.common import installation
from diff4splat.cli.common.precompile import (
    HEXPLANE,
    RASTER,
    RASTERIZER,
    TRACER,
    WORLDS,
    kernel_group,
    readiness,
)
from diff4splat.errors import Diff4SplatError

EXTRAS = (
    ("matplotlib", "plots", "pip install 'diff4splat[plot]'"),
    ("gsplat", "images on a GPU", "pip install 'diff4splat[cuda]'"),
)
"""(package, purpose, install command)."""
_WIDTH = 20

Rows = Iterable[tuple[str, str]]


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """Check the installation: versions, back ends, extras, and a test render."""

    warm: bool = False
    """Compile all kernels now instead of before their first use."""

    def run(self) -> None:
        """Print the table, or compile."""
        if self.warm:
            precompile_all()
            return
        print_rows(machine_rows())
        installation.require_packages()
        installation.load_libraries()
        print_rows(torch_rows())
        print_rows(backend_rows())
        print_rows(compiled_rows())
        print_rows(extra_rows())
        print_rows([("self-test", installation.self_test())])


def precompile_all() -> None:
    """Compile all kernels, and print how long each group took and where it is cached.

    Raises:
        Diff4SplatError: the renderer cannot run here.
    """
    precompile_group(WORLDS)
    precompile_group(HEXPLANE)
    if (reason := installation.unsupported_reason(RASTER, "cpu")) is not None:
        raise Diff4SplatError(f"renderer {RASTER}: {reason}")
    precompile_group(RASTERIZER)
    precompile_group(TRACER)


def precompile_group(name: str) -> None:
    """Compile one group of kernels, with a bar and a line of its own."""
    from diff4splat.cli.common.console import ConsolePhases, note
    from diff4splat.progress.precompile import precompile

    phases, group = ConsolePhases(), kernel_group(name)
    compiled = precompile(group, phases)
    folder = group.kernels[0].stats.cache_path
    cached = f"kept in {folder}" if folder else "not kept, because no folder can be written to"
    did = f"compiled {len(compiled)} kernels" if compiled else "was already compiled; loaded"
    note(f"{name}: {did} in {phases.seconds['compile']:.1f} s; {cached}")


def print_rows(rows: Rows) -> None:
    """Print one aligned line each, as soon as it is available."""
    for name, value in rows:
        print(f"{name:<{_WIDTH}}{value}", flush=True)


def machine_rows() -> Rows:
    """Rows that need no library."""
    from diff4splat import __version__

    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    yield "diff4splat", f"{__version__} in {Path(__file__).parents[1]}"
    yield "python", f"{platform.python_version()} in {sys.prefix}"
    yield "platform", f"{platform.system()} {platform.release()} {platform.machine()}"
    yield "cpu", f"{cpu_name()}, {usable} cores"
    yield "memory", f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 2**30:.1f} GiB"


def cpu_name() -> str:
    """The model name if the system has one, else the architecture."""
    try:
        match = re.search(r"^model name\s*: (.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        match = None
    return match[1] if match else platform.processor() or platform.machine()


def torch_rows() -> Rows:
    """PyTorch and its devices."""
    import torch

    threads = torch.get_num_threads()
    yield "torch", f"{torch.__version__}, {threads} thread{'s' if threads > 1 else ''}"
    if torch.cuda.is_available():
        yield "cuda", f"{torch.version.cuda} on {torch.cuda.get_device_name()}"
    elif torch.version.cuda is None:
        yield "cuda", "not available: this torch is built without it"
    else:
        yield "cuda", f"not available: no GPU found (torch is built for {torch.version.cuda})"


def backend_rows() -> Rows:
    """State of every rendering back end on the CPU, and on the GPU if available."""
    import torch

    from diff4splat.render.backends import BACKENDS

    devices = ("cpu", "cuda") if torch.cuda.is_available() else ("cpu",)
    for name in BACKENDS:
        for device in devices:
            reason = installation.unsupported_reason(name, device)
            state = installation.backend_readiness(name) if reason is None else f"refuses: {reason}"
            yield f"renderer {name}", state if len(devices) == 1 else f"{device}: {state}"


def compiled_rows() -> Rows:
    """State of the other compiled kernels."""
    yield TRACER, installation.tracer_readiness()
    yield HEXPLANE, readiness(HEXPLANE)
    yield WORLDS, readiness(WORLDS)


def extra_rows() -> Rows:
    """Optional packages: the version, or the install command."""
    for package, purpose, command in EXTRAS:
        yield package, installation.version(package) or f"not installed; for {purpose}: {command}"
