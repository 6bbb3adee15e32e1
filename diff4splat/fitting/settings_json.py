"""Overrides of fit settings as ``key=value``, with dotted keys such as ``density.budget``."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.fitting.settings import FitSettings
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.training.config_codec import TypedReader


def apply_changes(settings: FitSettings, changes: Sequence[str]) -> FitSettings:
    """Settings with ``changes`` applied; values are JSON or plain words.

    Raises:
        ConfigError: no "=", an unknown key, or a value of the wrong kind.
    """
    data = json.loads(json.dumps(asdict(settings)))
    for change in changes:
        key, equals, text = change.partition("=")
        if not equals:
            raise ConfigError(f"--set: expected key=value, got {change!r}")
        *outer, last = key.strip().split(".")
        target = data
        for name in outer:
            target = _group(target, name, key)
        target[last] = _parsed(text.strip())
    return TypedReader(error_type=ConfigError).read(FitSettings, data, "settings")


def _group(parent: dict[str, Any], name: str, key: str) -> dict[str, Any]:
    group = parent.get(name)
    if not isinstance(group, dict):
        groups = ", ".join(name for name, value in parent.items() if isinstance(value, dict))
        raise ConfigError(f"--set {key}: expected a group such as {groups or 'none'}, got {name!r}")
    return group


def _parsed(text: str) -> Any:
    try:
        return decode_json(text)
    except FileFormatError:
        return text
