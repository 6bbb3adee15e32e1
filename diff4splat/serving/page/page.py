"""The page for browsers, with the presets of camera paths in it.

The paths are stored: computing them would load torch into the server. ``drawn_paths`` makes them.
"""

import json
from importlib.resources import files

from diff4splat.paths.presets import PRESETS

POINTS = 33
PATHS_MARK = "/*paths*/{}"


def page_text() -> str:
    """HTML that needs nothing but the server's own API."""
    folder = files("diff4splat.serving").joinpath("page")
    page = folder.joinpath("index.html").read_text(encoding="utf-8")
    return page.replace(PATHS_MARK, folder.joinpath("paths.json").read_text(encoding="utf-8"))


def drawn_paths() -> dict[str, dict[str, object]]:
    """Summary, default amplitude and camera centres of every preset, for content at depth 1."""
    from diff4splat.geometry.camera import pinhole
    from diff4splat.paths.build import build_path
    from diff4splat.paths.settings import PathFrame, PathSettings

    view = PathFrame(camera=pinhole(64.0, (64, 64)), near_depth=1.0, focus_depth=1.0)
    settings = PathSettings(frames=POINTS, fps=24.0)
    return {
        name: {
            "summary": preset.summary,
            "amplitude": preset.default_amplitude,
            "points": [
                [round(value, 3) for value in point]
                for point in build_path(name, view, settings).cameras.position.tolist()
            ],
        }
        for name, preset in PRESETS.items()
    }


def paths_json() -> str:
    """The text of ``paths.json``."""
    return json.dumps(drawn_paths(), separators=(",", ":"))
