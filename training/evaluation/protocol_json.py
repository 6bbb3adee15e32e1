"""Protocols as JSON: every key must be there, none may be unknown, and numbers keep their kind."""

import json
from dataclasses import asdict, dataclass, fields, is_dataclass
from importlib import resources
from pathlib import Path
from types import GenericAlias
from typing import Literal, TypeVar, get_args, get_origin

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.io.existing import require_file
from diff4splat.training.evaluation.protocol import VERSION, Protocol

FORMAT = "diff4splat-evaluation"
PACKAGE = "diff4splat.training.evaluation.protocols"
Record = TypeVar("Record")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadedProtocol:
    """A protocol and the folder that its relative names start from."""

    protocol: Protocol
    folder: Path


def protocol_names() -> tuple[str, ...]:
    """Names of the protocols that ship."""
    files = resources.files(PACKAGE).iterdir()
    return tuple(sorted(Path(f.name).stem for f in files if f.name.endswith(".json")))


def load_protocol(name_or_file: str) -> LoadedProtocol:
    """A protocol that ships, by name, or a JSON file.

    Raises:
        ConfigError: neither a known name nor a name ending in .json, or a value out of range.
        FileFormatError: the file is no protocol, or from a newer version.
    """
    if name_or_file in protocol_names():
        text = (resources.files(PACKAGE) / f"{name_or_file}.json").read_text(encoding="utf-8")
        return LoadedProtocol(protocol=parse_protocol(text, name_or_file), folder=Path())
    if not name_or_file.endswith(".json"):
        known = ", ".join(protocol_names())
        raise ConfigError(f"--protocol: expected {known} or a .json file, got {name_or_file!r}")
    file = Path(name_or_file)
    require_file(file, "an evaluation protocol")
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{file}: expected JSON text, got {error}") from error
    return LoadedProtocol(protocol=parse_protocol(text, str(file)), folder=file.parent)


def parse_protocol(text: str, where: str) -> Protocol:
    """The protocol that ``protocol_json`` wrote; ``where`` is named in errors.

    Raises:
        FileFormatError: no JSON, another format or version, or a key too many or too few.
        ConfigError: a value out of range.
    """
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise FileFormatError(f"{where}: expected JSON, got {error}") from error
    if not isinstance(data, dict) or data.pop("format", None) != FORMAT:
        raise FileFormatError(f"{where}: expected the format {FORMAT!r}, got something else")
    version = data.pop("version", None)
    if version != VERSION:
        raise FileFormatError(
            f"{where}: expected version {VERSION}, got {version!r}; a newer diff4splat may read it"
        )
    return _record(Protocol, data, where)


def protocol_json(protocol: Protocol) -> str:
    """Every key, as indented JSON."""
    record = {"format": FORMAT, "version": VERSION, **asdict(protocol)}
    return json.dumps(record, indent=2) + "\n"


def _record(kind: type[Record], data: object, where: str) -> Record:
    if not isinstance(data, dict):
        raise FileFormatError(f"{where}: expected an object, got {type(data).__name__}")
    names = [field.name for field in fields(kind)]
    unknown, missing = sorted(set(data) - set(names)), sorted(set(names) - set(data))
    if unknown:
        raise FileFormatError(f"{where}: expected the keys {names}, got {unknown[0]!r}; remove it")
    if missing:
        raise FileFormatError(f"{where}: expected the key {missing[0]!r}, got none; add it")
    values = {f.name: _value(f.type, data[f.name], f"{where}.{f.name}") for f in fields(kind)}
    return kind(**values)


def _value(kind: object, value: object, where: str) -> object:
    """``value`` as ``kind``: a record, a tuple, one of some words, or a plain number or text."""
    if is_dataclass(kind):
        return _record(kind, value, where)
    if isinstance(kind, GenericAlias) and get_origin(kind) is tuple:
        return _tuple(get_args(kind), value, where)
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            raise FileFormatError(f"{where}: expected one of {get_args(kind)}, got {value!r}")
        return value
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float and number:
        return float(value)
    if type(value) is not kind:
        raise FileFormatError(f"{where}: expected {kind.__name__}, got {value!r}")
    return value


def _tuple(inner: tuple[object, ...], value: object, where: str) -> tuple[object, ...]:
    if not isinstance(value, list):
        raise FileFormatError(f"{where}: expected a list, got {value!r}")
    kinds = [inner[0]] * len(value) if inner[-1] is Ellipsis else list(inner)
    if len(kinds) != len(value):
        raise FileFormatError(f"{where}: expected {len(kinds)} values, got {len(value)}")
    pairs = zip(kinds, value, strict=True)
    return tuple(_value(kind, item, f"{where}[{i}]") for i, (kind, item) in enumerate(pairs))
