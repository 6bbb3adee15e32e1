"""The HTML page: template, style and scripts of this folder with a scene inside.

Nothing of a scene can leave the place where it is put: text is JSON without ``<``, ``>`` and ``&``,
and bytes are base64.
"""

import base64
import hashlib
import json
import re
from importlib import resources
from pathlib import Path

from diff4splat.errors import InputError
from diff4splat.io.atomic import write_text
from diff4splat.scene.scene import Scene
from diff4splat.viewer.keyframed import Keyframed, keyframed
from diff4splat.viewer.payload import pack_scene, require_page_size

SCRIPTS = (
    "linear.js",
    "payload.js",
    "sorter.js",
    "shaders.js",
    "renderer.js",
    "motion.js",
    "camera.js",
    "controls.js",
    "recorder.js",
    "panel.js",
    "main.js",
)
"""In the order in which the page runs them."""
_GLSL_SPACE = re.compile(r"\s*([=*/<>,;(){}?:])\s*")


def write_page(scene: Scene, file: Path) -> Keyframed:
    """Write the page of a scene, whole or not at all; returns what was lost on the way.

    Raises:
        InputError: the scene is larger than browsers can open.
        OutputError: the file cannot be written.
    """
    ready = keyframed(scene)
    require_page_size(ready.scene)
    write_text(file, page(ready))
    return ready


def write_page_or_reason(scene: Scene, file: Path) -> None:
    """Write the page; that of a scene that is too large holds the reason in its place.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        write_page(scene, file)
    except InputError as error:
        header = {"about": _about(scene, ()), "reason": str(error)}
        write_text(file, _filled(header, b""))


def page(ready: Keyframed) -> str:
    """The page as text."""
    payload = pack_scene(ready.scene)
    header = payload.full_header | {"about": _about(ready.scene, ready.notes)}
    return _filled(header, payload.bytes)


def _about(scene: Scene, notes: tuple[str, ...]) -> dict[str, object]:
    provenance = scene.provenance
    return {
        "title": provenance.prompt or "4D scene",
        "model": provenance.model,
        "generator": provenance.generator,
        "license": provenance.license,
        "untrained": provenance.untrained,
        "notes": notes,
    }


def _filled(header: dict[str, object], data: bytes) -> str:
    """The template with everything in its place."""
    code, style = script(), _asset("style.css")
    parts = {
        "POLICY": policy(code, style),
        "STYLE": style,
        "HEADER": json_text(header),
        "PAYLOAD": base64.b64encode(data).decode("ascii"),
        "SCRIPT": code,
    }
    # In one pass over the template: a prompt may hold the name of a part.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _asset("page.html"))


def script() -> str:
    """All scripts as one function, so that none of their names leaves the page."""
    body = "\n".join(_compact(name) for name in SCRIPTS)
    return f'"use strict";\n(() => {{\n{body}\n}})();'


def policy(code: str, style: str) -> str:
    """A content security policy: this script and this style, a worker, and no network at all."""
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src '{_digest(code)}'",
            f"style-src '{_digest(style)}'",
            "worker-src blob:",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def json_text(value: object) -> str:
    """JSON that may stand inside of an HTML element."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _compact(name: str) -> str:
    """A script without comments and indentation, which stay in the sources."""
    lines = (line.strip() for line in _asset(name).splitlines())
    lines = (line for line in lines if line and not line.startswith("//"))
    if name == "shaders.js":
        lines = (line if line[0] == "#" else _GLSL_SPACE.sub(r"\1", line) for line in lines)
    return "\n".join(lines)


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _asset(name: str) -> str:
    return (resources.files(__package__) / "page" / name).read_text(encoding="utf-8").rstrip()
