"""Compilation of kernels ahead of use, as a phase of a command."""

from typing import TYPE_CHECKING

from diff4splat.progress.phases import Phases

if TYPE_CHECKING:
    from diff4splat.kernels.group import KernelGroup


def precompile(group: "KernelGroup", phases: Phases) -> tuple[str, ...]:
    """Load or compile every kernel of ``group``; returns the names of the compiled ones."""
    compiled = []
    with phases.phase("compile", group.kernel_count()) as advance:

        def count(name: str) -> None:
            compiled.append(name)
            advance()

        group.precompile(count)
    return tuple(compiled)


def ensure_precompiled(group: "KernelGroup", phases: Phases) -> None:
    """Compile the kernels of ``group``, unless they are ready."""
    if not group.is_ready():
        precompile(group, phases)
