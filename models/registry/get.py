"""A public model into the cache."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from diff4splat.errors import ConfigError
from diff4splat.io.file_digest import file_sha256
from diff4splat.io.locks import sole_writer
from diff4splat.io.require_file import is_file
from diff4splat.models.registry.cache import (
    address_of,
    model_folder,
    record_hashes,
    recorded_hashes,
)
from diff4splat.models.registry.catalog import ModelFile, PublicModel
from diff4splat.models.registry.download import Download, download
from diff4splat.progress.phases import Phases

Note = Callable[[str], None]


def require_license(model: PublicModel, accepted: bool) -> None:
    """Refuse weights that may not be used freely, unless asked for.

    Raises:
        ConfigError: the licence restricts use, and nobody accepted that.
    """
    if not (model.permissive or accepted):
        raise ConfigError(
            f"{model.name}: expected --accept-license for weights under {model.license}, which "
            f"restricts use (often to research or non-commercial); read {model.source}"
        )


def get_model(model: PublicModel, phases: Phases, note: Note) -> Path:
    """Download what is missing, and return the graph; ``note`` gets a line per file.

    Raises:
        InputError: the server or the file cannot be trusted.
        OutputError: the cache cannot be written, or another process writes there.
    """
    folder = model_folder(model)
    folder.mkdir(parents=True, exist_ok=True)
    with sole_writer(folder):
        recorded = recorded_hashes(folder)
        for file in model.files:
            wanted = replace(file, sha256=file.sha256 or recorded.get(file.name))
            digest = _get_file(model, wanted, phases)
            recorded[file.name] = digest
            record_hashes(folder, recorded)
            note(_line(file, wanted, digest))
    return folder / model.files[0].name


def _get_file(model: PublicModel, file: ModelFile, phases: Phases) -> str:
    target = model_folder(model) / file.name
    if file.sha256 is not None and is_file(target) and file_sha256(target) == file.sha256:
        return file.sha256
    address = address_of(model, file)
    wanted = Download(address=address, target=target, bytes=file.bytes, sha256=file.sha256)
    return download(wanted, phases)


def _line(known: ModelFile, wanted: ModelFile, digest: str) -> str:
    if known.sha256:
        return f"{known.name}: SHA-256 {digest}, as published"
    if wanted.sha256:
        return f"{known.name}: SHA-256 {digest}, as with the first download"
    return f"{known.name}: SHA-256 {digest}; nobody states one, so this is trusted from now on"
