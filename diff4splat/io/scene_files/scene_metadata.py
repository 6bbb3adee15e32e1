"""The text part of a scene file: format mark, version and one JSON object.

The JSON object has ``motion``, ``path``, ``provenance``, ``rendering`` and ``conventions``. Readers
ignore keys that they do not know; the version changes only when an old reader would show something
wrong. Files without coded tensors are written as version 1, which every reader knows.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from diff4splat.errors import FileFormatError
from diff4splat.io.scene_files.tensor_checks import take_numbers, take_value
from diff4splat.paths.formats.json_text import decode_json
from diff4splat.scene.scene import DILATION_PX2, Provenance

FORMAT = "diff4splat-scene"
VERSION = 2
"""The newest that is read; coded tensors came with 2."""
PLAIN_VERSION = 1
CONVENTIONS = {
    "axes": "x right, y down, z forward (OpenCV), right-handed",
    "color": "sRGB-referred, 0.5 + harmonics, RGB in [0, 1]",
    "length_unit": "scene units",
    "time_unit": "seconds",
    "quaternions": "w x y z",
    "values": "activated: scales are standard deviations, opacities are probabilities",
    "pixels": "centres at +0.5, intrinsics in pixels of path.size_px (height, width)",
}


MAX_SIDE_PX = 16384
"""Larger images are damage, not wishes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneMetadata:
    """Everything about a scene that is not a tensor."""

    motion: Mapping[str, Any]
    """Settings of the motion, see ``motion_tensors``."""
    size_px: tuple[int, int]
    """(height, width) of the suggested path's images."""
    provenance: Provenance
    dilation_px2: float = DILATION_PX2
    """What the scene asks renderers for; files that do not say mean the usual."""
    encodings: Mapping[str, Any] = field(default_factory=dict)
    """How each coded tensor was coded, see ``coding/coded_tensors.py``."""
    compression: Mapping[str, Any] = field(default_factory=dict)
    """Name and tolerances of what coded them, for people; readers need none of it."""


def encode(metadata: SceneMetadata) -> dict[str, str]:
    """The metadata as the strings that a file stores."""
    document = {
        "conventions": CONVENTIONS,
        "motion": dict(metadata.motion),
        "path": {"size_px": list(metadata.size_px)},
        "provenance": asdict(metadata.provenance),
    }
    if metadata.dilation_px2 != DILATION_PX2:
        document["rendering"] = {"dilation_px2": metadata.dilation_px2}
    version = PLAIN_VERSION
    if metadata.encodings:
        version = VERSION
        document["encodings"] = dict(metadata.encodings)
        document["compression"] = dict(metadata.compression)
    text = json.dumps(document, sort_keys=True)
    return {"format": FORMAT, "version": str(version), "scene": text}


def decode(strings: Mapping[str, str]) -> SceneMetadata:
    """The metadata of a file.

    Raises:
        FileFormatError: another format, a newer version, no JSON, or a value of the wrong type.
    """
    _require_version(strings)
    document = _parse(strings.get("scene", ""))
    provenance = take_value(document, "provenance", dict)
    height, width = take_numbers(take_value(document, "path", dict), "size_px", 2, integer=True)
    if not (1 <= height <= MAX_SIDE_PX and 1 <= width <= MAX_SIDE_PX):
        raise FileFormatError(
            f"path.size_px: expected 1 to {MAX_SIDE_PX} pixels per side, got {height} and {width}"
        )
    return SceneMetadata(
        motion=take_value(document, "motion", dict),
        size_px=(height, width),
        provenance=Provenance(
            generator=take_value(provenance, "generator", str),
            model=take_value(provenance, "model", str, "none"),
            weights_sha256=take_value(provenance, "weights_sha256", str, "none"),
            seed=take_value(provenance, "seed", int | None, None),
            prompt=take_value(provenance, "prompt", str | None, None),
            license=take_value(provenance, "license", str, "unknown"),
            untrained=take_value(provenance, "untrained", bool, False),
        ),
        dilation_px2=_dilation(take_value(document, "rendering", dict, {})),
        encodings=take_value(document, "encodings", dict, {}),
        compression=take_value(document, "compression", dict, {}),
    )


def _dilation(rendering: Mapping[str, Any]) -> float:
    found = take_value(rendering, "dilation_px2", float | int, DILATION_PX2)
    if not 0 <= found < math.inf:
        raise FileFormatError(
            f"rendering.dilation_px2: expected a finite number of at least 0, got {found}"
        )
    return float(found)


def _require_version(strings: Mapping[str, str]) -> None:
    found = strings.get("format", "")
    if found != FORMAT:
        got = f"format {found[:40]!r}" if found else "a .safetensors file without that mark"
        raise FileFormatError(f"expected format '{FORMAT}', got {got}; check the path")
    version = strings.get("version", "")
    if not (version.isascii() and version.isdigit() and len(version) < 10 and int(version) > 0):
        raise FileFormatError(
            f"expected a version number, got {version[:20]!r}; copy the file again"
        )
    if int(version) > VERSION:
        raise FileFormatError(
            f"written by a newer diff4splat (version {int(version)}, this one reads up to "
            f"{VERSION}); update diff4splat"
        )


def _parse(text: str) -> dict[str, Any]:
    try:
        document = decode_json(text)
    except FileFormatError as error:
        raise FileFormatError(f"metadata 'scene': {error}") from error
    if not isinstance(document, dict):
        raise FileFormatError(f"metadata 'scene': expected a JSON object, got {text[:40]!r}")
    return document
