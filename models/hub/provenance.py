"""Provenance of a model's weights: which parts are trained, their licence and their origin.

provenance.json, version 2:

    {"format": "diff4splat-model", "version": 2, "trained": ["vae", "ldrm"],
     "license": "Apache-2.0", "origin": "one line"}

Version 1 had ``"untrained": true`` or ``false`` for the model as a whole. Only a list of trained
parts allows a folder without the others: elsewhere a part without a file is a broken copy.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from diff4splat.errors import CheckpointError
from diff4splat.io.atomic import write_text
from diff4splat.io.require_file import is_file, read_text
from diff4splat.models.hub.legacy import SOURCES
from diff4splat.models.hub.weight_files import is_version_1
from diff4splat.models.networks import PARTS
from diff4splat.paths.formats.json_text import decode_json

PROVENANCE_FILE = "provenance.json"
FORMAT, VERSION = "diff4splat-model", 2
"""Of the file that this release writes."""
NOT_STATED = "not stated"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelProvenance:
    """Where weights come from."""

    trained: frozenset[str] = frozenset()
    """Names of the parts that are trained to their end."""
    may_lack: frozenset[str] = frozenset()
    """Parts that need no file: those that a list of trained parts leaves out."""
    license: str = NOT_STATED
    """Of the weights, as an SPDX name."""
    origin: str = NOT_STATED
    """One line for people: trained by whom, on what."""


def read_provenance(folder: Path) -> ModelProvenance:
    """The provenance of a model folder; without the file nothing is trained.

    Raises:
        CheckpointError: the file is damaged, or from a newer version.
    """
    file = folder / PROVENANCE_FILE
    if not is_file(file):
        return ModelProvenance()
    text = read_text(file, "a JSON object of what is trained", CheckpointError)
    try:
        provenance = _parse(decode_json(text), file)
    except (ValueError, KeyError, TypeError) as error:
        if isinstance(error, CheckpointError):
            raise
        raise CheckpointError(
            f"{file}: expected a JSON object with 'trained', or 'untrained' in version 1, "
            "got something else; fetch the model again"
        ) from error
    return _with_priors(provenance) if is_version_1(folder) else provenance


def write_provenance(provenance: ModelProvenance, folder: Path) -> None:
    """Write version 2; parts are listed in the order of ``PARTS``."""
    record = {
        "format": FORMAT,
        "version": VERSION,
        "trained": [part for part in PARTS if part in provenance.trained],
        "license": provenance.license,
        "origin": provenance.origin,
    }
    text = json.dumps(record, indent=2, ensure_ascii=False)
    write_text(folder / PROVENANCE_FILE, text + "\n")


def _with_priors(provenance: ModelProvenance) -> ModelProvenance:
    """Version 1 trained the priors with the part whose file held them."""
    priors = {part for part, (file, _) in SOURCES.items() if file in provenance.trained}
    trained = provenance.trained | priors
    return replace(provenance, trained=trained, may_lack=provenance.may_lack - priors)


def _parse(record: Mapping[str, Any], file: Path) -> ModelProvenance:
    version = record.get("version", 1) if isinstance(record, dict) else 1
    if version == 1:
        return ModelProvenance(trained=frozenset() if record["untrained"] else frozenset(PARTS))
    if version != VERSION:
        raise CheckpointError(
            f"{file}: expected version 1 or {VERSION}, got {version!r}; "
            "a newer diff4splat may read it"
        )
    trained = record["trained"]
    if not isinstance(trained, list) or not set(trained) <= set(PARTS):
        raise CheckpointError(
            f"{file}: expected 'trained' as a list of {', '.join(PARTS)}, got {trained!r}; "
            "fetch the model again"
        )
    return ModelProvenance(
        trained=frozenset(trained),
        may_lack=frozenset(PARTS).difference(trained),
        license=str(record.get("license", NOT_STATED)),
        origin=str(record.get("origin", NOT_STATED)),
    )
