"""``diff4splat doctor``: versions, back ends and extras of this installation, and a self-test.

The table is printed line by line, so that a crash still leaves the lines before it.
"""

import os
import platform
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diff4splat.cli import fields, installation, worlds
from diff4splat.errors import Diff4SplatError

if TYPE_CHECKING:
    from diff4splat.progress.phases import Phases

EXTRAS = (
    ("matplotlib", "plots", "pip install 'diff4splat[plot]'"),
    ("gsplat", "pictures on a GPU", "pip install 'diff4splat[cuda]'"),
)
"""(package, purpose, install command)."""
_WIDTH = 20
TRACER, FIELDS = "renderer trace", "hexplane fields"

Rows = Iterable[tuple[str, str]]


@dataclass(frozen=True, kw_only=True)
class Doctor:
    """Check the installation: versions, back ends, extras, and a test render."""

    warm: bool = False
    """Compile all kernels now instead of before their first use."""

    def run(self) -> None:
        """Print the table, or compile."""
        if self.warm:
            warm_up()
            return
        print_rows(machine_rows())
        installation.require_packages()
        installation.load_libraries()
        print_rows(torch_rows())
        print_rows(backend_rows())
        print_rows(compiled_rows())
        print_rows(extra_rows())
        print_rows([("self-test", installation.self_test())])


def warm_up() -> None:
    """Compile all kernels; print the time and the cache folder.

    Raises:
        Diff4SplatError: the renderer cannot run here.
    """
    from diff4splat.cli.renderer import COMPILED, compile_ahead, compile_renderer
    from diff4splat.data_prep.synthetic.drawing.compiled import KERNELS as DRAWING
    from diff4splat.data_prep.synthetic.drawing.warm import compile_drawing
    from diff4splat.render.raster.jit import KERNELS
    from diff4splat.render.trace import warm as tracer
    from diff4splat.render.trace.compiled import KERNELS as TRACING

    warm_one("worlds", compile_drawing, DRAWING)
    warm_one(FIELDS, partial(compile_ahead, fields), fields.kernels())
    reason = installation.unsupported_reason(COMPILED, "cpu")
    if reason is not None:
        raise Diff4SplatError(f"renderer {COMPILED}: {reason}")
    warm_one(f"renderer {COMPILED}", compile_renderer, KERNELS)
    warm_one(TRACER, partial(compile_ahead, tracer), TRACING)


def warm_one(
    label: str, compile_all: "Callable[[Phases], tuple[str, ...]]", kernels: list[Any]
) -> None:
    """Compile one list of ``kernels`` with a progress bar and a summary line."""
    from diff4splat.cli.console import ConsolePhases, note

    phases = ConsolePhases()
    compiled = compile_all(phases)
    folder = kernels[0].stats.cache_path
    location = f"kept in {folder}" if folder else "not kept, because no folder can be written to"
    did = f"compiled {len(compiled)} kernels" if compiled else "was already compiled; loaded"
    note(f"{label}: {did} in {phases.seconds['compile']:.1f} s; {location}")


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
            state = installation.readiness(name) if reason is None else f"refuses: {reason}"
            yield f"renderer {name}", state if len(devices) == 1 else f"{device}: {state}"


def compiled_rows() -> Rows:
    """State of the other compiled kernels."""
    yield TRACER, installation.tracer_readiness()
    yield FIELDS, installation.compiled_or_not(fields.is_ready(), fields.COMPILE_S)
    yield "worlds", worlds.readiness()


def extra_rows() -> Rows:
    """Optional packages: the version, or the install command."""
    for package, purpose, command in EXTRAS:
        yield package, installation.version(package) or f"not installed; for {purpose}: {command}"
