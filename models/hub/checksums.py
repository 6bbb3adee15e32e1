"""SHA256SUMS of a model folder: one line ``digest  name`` per file, as ``sha256sum -c`` reads it.

A folder with such a list is checked whenever it is read. The list
holds the configuration, the provenance and the weights. The model card is not in it: its text may
be corrected without new weights.
"""

import re
from collections.abc import Collection
from pathlib import Path

from diff4splat.errors import FileFormatError
from diff4splat.io.atomic import write_text
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.require_file import read_text
from diff4splat.models.hub.provenance import PROVENANCE_FILE
from diff4splat.models.hub.weight_files import CONFIG_FILE, part_file
from diff4splat.models.networks import PARTS
from diff4splat.models.wan.tokenizer import TOKENIZER_FILE

SUMS_FILE = "SHA256SUMS"
_LINE = re.compile(r"([0-9a-f]{64})  (\S+)")


def listed_files(folder: Path) -> list[Path]:
    """The files of a model folder that a list has to name."""
    files = [folder / CONFIG_FILE, folder / PROVENANCE_FILE, folder / TOKENIZER_FILE]
    files += [part_file(folder, part) for part in PARTS]
    return [file for file in files if file.is_file()]


def write_sums(folder: Path) -> None:
    """List the files of the folder."""
    lines = [f"{file_sha256(file)}  {file.name}\n" for file in listed_files(folder)]
    write_text(folder / SUMS_FILE, "".join(lines))


def require_complete(folder: Path, advice: str, names: Collection[str] | None = None) -> None:
    """Compare every file with the list; ``advice`` is how to get the folder again.

    With ``names`` only those files are compared; names of files that do not exist and that the
    list does not name are ignored.

    Raises:
        FileFormatError: a file is damaged, missing, or not in the list.
    """
    sums = _read_sums(folder / SUMS_FILE, advice)
    present = {file.name for file in listed_files(folder)}
    compared = present | sums.keys()
    for name in sorted(compared if names is None else compared.intersection(names)):
        if name not in sums:
            raise FileFormatError(
                f"{folder / name}: expected a file that {SUMS_FILE} names, got another; {advice}"
            )
        got = file_sha256(folder / name) if name in present else "no file"
        if got != sums[name]:
            raise FileFormatError(
                f"{folder / name}: expected SHA-256 {sums[name][:16]}…, got {got[:16]}; "
                f"the file is damaged, {advice}"
            )


def _read_sums(file: Path, advice: str) -> dict[str, str]:
    try:
        lines = read_text(file, "a list of checksums").splitlines()
    except FileFormatError as error:
        raise FileFormatError(
            f"{file}: expected a list of checksums, got none that can be read; {advice}"
        ) from error
    matches = [_LINE.fullmatch(line) for line in lines]
    if not matches or None in matches:
        raise FileFormatError(f"{file}: expected lines 'digest  name', got others; {advice}")
    return {match[2]: match[1] for match in matches}
