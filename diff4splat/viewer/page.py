"""The HTML page: template, style and scripts of this folder with a scene inside.

Nothing of a scene can leave the place where it is put: text is JSON without ``<``, ``>`` and ``&``,
and bytes are base64.
"""

import base64
import json
import re
from importlib import resources
from pathlib import Path

from diff4splat.io.atomic import write_text
from diff4splat.scene.scene import Scene
from diff4splat.viewer.keyframed import Keyframed, keyframed
from diff4splat.viewer.payload import pack_scene

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


def write_page(scene: Scene, file: Path) -> Keyframed:
    """Write the page of a scene, whole or not at all; returns what was lost on the way.

    Raises:
        OutputError: the file cannot be written.
    """
    ready = keyframed(scene)
    write_text(file, page(ready))
    return ready


def page(ready: Keyframed) -> str:
    """The page as text."""
    scene = ready.scene
    payload, provenance = pack_scene(scene), scene.provenance
    about = {
        "title": provenance.prompt or "4D scene",
        "model": provenance.model,
        "generator": provenance.generator,
        "license": provenance.license,
        "untrained": provenance.untrained,
        "notes": ready.notes,
    }
    parts = {
        "STYLE": _asset("style.css"),
        "HEADER": json_text(payload.full_header | {"about": about}),
        "PAYLOAD": base64.b64encode(payload.bytes).decode("ascii"),
        "SCRIPT": script(),
    }
    # In one pass over the template: a prompt may hold the name of a part.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _asset("page.html"))


def script() -> str:
    """All scripts as one function, so that none of their names leaves the page."""
    body = "\n".join(_asset(name) for name in SCRIPTS)
    return f'"use strict";\n(() => {{\n{body}\n}})();'


def json_text(value: object) -> str:
    """JSON that may stand inside of an HTML element."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _asset(name: str) -> str:
    return (resources.files(__package__) / "page" / name).read_text(encoding="utf-8").rstrip()
