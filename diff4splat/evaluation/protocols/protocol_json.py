"""Read and write protocols as strict JSON: no missing or unknown keys, and exact number types.

Only ``input_stride`` is optional; the default is 1.
"""

import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.evaluation.protocols.protocol import VERSION, Protocol
from diff4splat.io.require_file import read_text
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.training.config_codec import TypedReader

FORMAT = "diff4splat-evaluation"
PACKAGE = "diff4splat.evaluation.protocols"


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedProtocol:
    """A protocol, and the base folder of its relative paths."""

    protocol: Protocol
    folder: Path


def protocol_names() -> tuple[str, ...]:
    """Names of the bundled protocols."""
    files = resources.files(PACKAGE).iterdir()
    return tuple(sorted(Path(f.name).stem for f in files if f.name.endswith(".json")))


def load_protocol(name_or_file: str) -> LoadedProtocol:
    """Load a bundled protocol by name, or a JSON file.

    Raises:
        ConfigError: neither a known name nor a name ending in .json, or a value out of range.
        FileFormatError: the file is not a protocol, or from a newer version.
    """
    if name_or_file in protocol_names():
        text = (resources.files(PACKAGE) / f"{name_or_file}.json").read_text(encoding="utf-8")
        return LoadedProtocol(protocol=parse_protocol(text, name_or_file), folder=Path())
    if not name_or_file.endswith(".json"):
        known = ", ".join(protocol_names())
        raise ConfigError(f"--protocol: expected {known} or a .json file, got {name_or_file!r}")
    file = Path(name_or_file)
    text = read_text(file, "an evaluation protocol")
    return LoadedProtocol(protocol=parse_protocol(text, str(file)), folder=file.parent)


def parse_protocol(text: str, where: str) -> Protocol:
    """Parse the text that ``protocol_json`` wrote; errors name ``where``.

    Raises:
        FileFormatError: not JSON, another format or version, or a missing or unknown key.
        ConfigError: a value out of range.
    """
    try:
        data = decode_json(text)
    except FileFormatError as error:
        raise FileFormatError(f"{where}: {error}") from error
    if not isinstance(data, dict) or data.pop("format", None) != FORMAT:
        raise FileFormatError(f"{where}: expected the format {FORMAT!r}, got something else")
    version = data.pop("version", None)
    if version != VERSION:
        raise FileFormatError(
            f"{where}: expected version {VERSION}, got {version!r}; a newer diff4splat may read it"
        )
    return TypedReader(error_type=FileFormatError).read(Protocol, data, where)


def protocol_json(protocol: Protocol) -> str:
    """The protocol as indented JSON."""
    record = {"format": FORMAT, "version": VERSION, **protocol.record()}
    return json.dumps(record, indent=2) + "\n"
