"""Adapters from files: our own folder first, then the folders of ``--plugins``.

A plug-in is code that the person who names its folder chose to run; nothing shields this machine
from it. A file that cannot be loaded becomes a line in the table, not a crash.
"""

import importlib.util
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from adapter import Adapter

from diff4splat.errors import ConfigError, InputError

BUILT_IN = Path(__file__).parent / "adapters"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """One renderer of the comparison, by the file that brings it in."""

    name: str
    file: Path
    unavailable: str | None = None
    """Why it cannot run here."""


def load(file: Path) -> Adapter:
    """The module in ``file``.

    Raises:
        InputError: it cannot be loaded, or lacks a name that every adapter has.
    """
    name = f"renderer_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None, "a path that ends in .py always has a loader"
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses of the module look it up while it is still being executed.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{file}: expected an adapter, but it fails to load: {reason}") from error
    if not isinstance(module, Adapter):
        raise InputError(f"{file}: expected NAME, unavailable and prepare; see adapter.py")
    return module


def find_peers(plugins: Sequence[Path], wanted: Sequence[str]) -> list[Peer]:
    """Every adapter, or those named in ``wanted``, ours first.

    Raises:
        ConfigError: a folder does not exist, or a wanted name is unknown.
    """
    peers = [_peer(file) for folder in (BUILT_IN, *plugins) for file in _files(folder)]
    known = {peer.name: peer for peer in peers}
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise ConfigError(f"--peers: expected names among {', '.join(known)}, got {unknown[0]}")
    return [known[name] for name in wanted] if wanted else list(known.values())


def _files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise ConfigError(f"--plugins: expected a folder with adapters, got {folder}")
    # The renderer that everything is compared with comes first.
    return sorted(folder.glob("*.py"), key=lambda file: (_OURS.get(file.stem, len(_OURS)), file))


_OURS = {"raster": 0, "reference": 1}


def _peer(file: Path) -> Peer:
    try:
        adapter = load(file)
        reason = adapter.unavailable()
    except InputError as error:
        return Peer(name=file.stem, file=file, unavailable=str(error))
    return Peer(name=adapter.NAME, file=file, unavailable=reason)
