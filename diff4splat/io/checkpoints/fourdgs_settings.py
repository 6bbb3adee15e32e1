"""The active heads of a 4DGaussians model, from the ``cfg_args`` text beside its checkpoints.

The file is the printed form of a Python ``Namespace``. It is parsed, never evaluated, and only
literal values are read.
"""

import ast
from pathlib import Path

from diff4splat.errors import FileFormatError

DEFAULT_HEADS = ("position", "rotation", "scale")
"""Heads that the program uses by default."""
_SWITCHED_OFF_BY = {
    "position": "no_dx",
    "rotation": "no_dr",
    "scale": "no_ds",
    "opacity": "no_do",
    "color": "no_dshs",
}
_REFUSED = ("apply_rotation", "static_mlp", "empty_voxel", "no_grid", "grid_pe")
"""Experimental switches that change the field, and are not supported."""
_LARGEST_BYTES = 1 << 20


def heads_in_use(folder: Path) -> tuple[str, ...]:
    """Active heads of a run, from ``cfg_args`` in ``folder`` or the two folders above it.

    Without such a file, the defaults of the program.

    Raises:
        FileFormatError: the file has another format, or the run used an experimental switch.
    """
    for place in (folder, *folder.resolve().parents[:2]):
        file = place / "cfg_args"
        if file.is_file():
            return _heads(_switches(file), file)
    return DEFAULT_HEADS


def _switches(file: Path) -> dict[str, object]:
    """Literal values by name; other values are skipped."""
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise ValueError("larger than any settings")
        call = ast.parse(file.read_text(encoding="utf-8").strip(), mode="eval").body
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError) as error:
        raise _unlike_settings(file) from error
    if not isinstance(call, ast.Call):
        raise _unlike_settings(file)
    values = ((keyword.arg, keyword.value) for keyword in call.keywords)
    return {k: v.value for k, v in values if k is not None and isinstance(v, ast.Constant)}


def _unlike_settings(file: Path) -> FileFormatError:
    return FileFormatError(
        f"{file}: expected the text 'Namespace(name=value, ...)', got something else; "
        "name the heads yourself"
    )


def _heads(switches: dict[str, object], file: Path) -> tuple[str, ...]:
    for name in _REFUSED:
        if switches.get(name):
            raise FileFormatError(f"{file}: expected a run without {name}, got {switches[name]!r}")
    off = {head for head, name in _SWITCHED_OFF_BY.items() if switches.get(name, True) is True}
    # A missing switch has its default: the first three heads on, the others off.
    off -= {head for head in DEFAULT_HEADS if _SWITCHED_OFF_BY[head] not in switches}
    return tuple(head for head in _SWITCHED_OFF_BY if head not in off)
