"""What a graph from outside may not do: reach other files, or need code that comes with no file."""

from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.models.depth_priors.graph_facts import GraphFacts

KNOWN_DOMAINS = frozenset({"", "ai.onnx", "ai.onnx.ml", "com.microsoft"})
"""Sets of operators that ONNX Runtime has built in."""


def require_safe(file: Path, facts: GraphFacts) -> None:
    """Check operators and external weights.

    Raises:
        FileFormatError: custom operators, or weights absent or outside of the file's folder.
    """
    own = {domain for domain, _ in facts.functions}
    foreign = {node.domain for node in facts.nodes} - KNOWN_DOMAINS - own
    if foreign:
        operators = sorted({node.operator for node in facts.nodes if node.domain in foreign})
        raise FileFormatError(
            f"{file}: expected operators of ONNX alone, got {', '.join(operators[:5])} of "
            f"{', '.join(sorted(foreign)[:3])}; export the network without custom operators"
        )
    for name in sorted(facts.external_files):
        _require_inside(file, name)


def _require_inside(file: Path, name: str) -> None:
    folder = file.parent
    try:
        outside = Path(name).is_absolute() or not _is_below(folder / name, folder)
        absent = not outside and not (folder / name).is_file()
    except (OSError, ValueError):
        outside, absent = False, True
    if outside:
        raise FileFormatError(
            f"{file}: expected weights beside it, got {name!r}, which is outside of its folder; "
            "put the files into one folder and export again"
        )
    if absent:
        raise FileFormatError(
            f"{file}: expected its weights in {name!r} beside it, got no such file; "
            "download that file too"
        )


def _is_below(target: Path, folder: Path) -> bool:
    """Whether a name stays below a folder; links count as what they point to.

    A cache may hold the graph itself as a link, beside which weights are links too.
    """
    written = Path(*[part for part in target.parts if part != "."])
    return ".." not in written.relative_to(folder).parts and target.resolve().is_relative_to(
        folder.resolve()
    )
