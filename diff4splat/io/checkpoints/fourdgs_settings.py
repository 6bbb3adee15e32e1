"""The active heads of a 4DGaussians model, from the ``cfg_args`` text beside its checkpoints.

The file is the printed form of a Python ``Namespace``. Only truth values are read, by name: a
parser of Python would need exponential time for some of what can stand there.
"""

import re
from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.io.require_file import is_file, read_text

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
_NAMESPACE = re.compile(r"Namespace\(.*\)", re.DOTALL)
_SETTING = re.compile(r"[(\s,](\w{1,60})=(True|False|[0-9]{1,9})(?=[,)])")
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")


def heads_in_use(folder: Path) -> tuple[str, ...]:
    """Active heads of a run, from ``cfg_args`` in ``folder`` or the two folders above it.

    Without such a file, the defaults of the program.

    Raises:
        FileFormatError: the file has another format, or the run used an experimental switch.
    """
    for place in (folder, *folder.resolve().parents[:2]):
        file = place / "cfg_args"
        if is_file(file):
            return _heads(_switches(file), file)
    return DEFAULT_HEADS


def _switches(file: Path) -> dict[str, bool]:
    """Truth values and whole numbers by name, as truth values; others are skipped."""
    try:
        text = read_text(file, "the settings of 4DGaussians").strip()
    except FileFormatError as error:
        raise _unlike_settings(file) from error
    if len(text) > _LARGEST_BYTES or _NAMESPACE.fullmatch(text) is None:
        raise _unlike_settings(file)
    plain = _QUOTED.sub("''", text)
    return {match[1]: match[2] not in ("False", "0") for match in _SETTING.finditer(plain)}


def _unlike_settings(file: Path) -> FileFormatError:
    return FileFormatError(
        f"{file}: expected the text 'Namespace(name=value, ...)', got something else; "
        "name the heads yourself"
    )


def _heads(switches: dict[str, bool], file: Path) -> tuple[str, ...]:
    for name in _REFUSED:
        if switches.get(name):
            raise FileFormatError(f"{file}: expected a run without {name}, got {switches[name]!r}")
    off = {head for head, name in _SWITCHED_OFF_BY.items() if switches.get(name, True) is True}
    # A missing switch has its default: the first three heads on, the others off.
    off -= {head for head in DEFAULT_HEADS if _SWITCHED_OFF_BY[head] not in switches}
    return tuple(head for head in _SWITCHED_OFF_BY if head not in off)
