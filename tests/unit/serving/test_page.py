"""The stored camera paths are those of the presets."""

import json

from diff4splat.serving.page.page import drawn_paths, page_text, paths_json


def test_stored_paths_are_those_of_the_presets() -> None:
    page = page_text()
    start = page.index("const PATHS = ") + len("const PATHS = ")
    stored = json.loads(page[start : page.index(";\n", start)])
    assert json.dumps(stored, separators=(",", ":")) == paths_json()
    assert drawn_paths()["static"]["points"][0] == [0.0, 0.0, 0.0]
