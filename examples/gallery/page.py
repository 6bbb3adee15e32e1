"""The gallery as one HTML page, with all files beside it."""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import groupby
from pathlib import Path

from examples.gallery.items import Item
from examples.gallery.make import Made

STYLE = """
:root { color-scheme: light dark; --line: #8884; --dim: #777 }
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 76rem; padding: 2rem 1rem }
h1 { margin: 0 } h2 { margin: 2.5rem 0 .8rem; border-bottom: 1px solid var(--line) }
.items { display: grid; gap: 1.5rem; grid-template-columns: repeat(auto-fill, minmax(17rem, 1fr)) }
figure { margin: 0; border: 1px solid var(--line); border-radius: 8px; overflow: hidden }
video { display: block; width: 100%; aspect-ratio: 4 / 3; object-fit: contain; background: #111 }
figcaption { padding: .7rem .9rem } h3 { margin: 0 0 .2rem; font-size: 1rem }
p { margin: 0 0 .6rem } small { color: var(--dim); display: block; margin-top: .5rem }
a { margin-right: .9rem }
"""
HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Gallery of diff4splat</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}</style></head>
<body><h1>Gallery of diff4splat</h1>
<p>Scenes of moving 3D Gaussians. Open a viewer to orbit, fly and stop the time. Costs are those of
the machine that made this page.</p>
"""
FIGURE = """<figure><video src="{video}" autoplay loop muted playsinline controls></video>
<figcaption><h3>{title}</h3><p>{text}</p>
<a href="{viewer}">Open the viewer</a><a href="{scene}" download>Scene file</a>
<small>{seconds:.0f} s · {memory:.1f} GB of memory · scene file {scene_mb:.1f} MB · viewer
{viewer_mb:.1f} MB</small></figcaption></figure>
"""


def write_page(items: Sequence[Item], made: Mapping[str, Made], gallery: Path) -> Path:
    """``index.html`` in the gallery's folder, with the items that were made."""
    parts = [HEAD.format(style=STYLE)]
    shown = [item for item in items if item.name in made]
    for group, members in groupby(shown, key=lambda item: item.group):
        figures = "".join(_figure(item, made[item.name], gallery) for item in members)
        parts.append(f'<h2>{escape(group)}</h2>\n<div class="items">\n{figures}</div>\n')
    partial, page = gallery / ".index.html", gallery / "index.html"
    partial.write_text("".join([*parts, "</body></html>\n"]), encoding="utf-8")
    partial.replace(page)
    return page


def _figure(item: Item, made: Made, gallery: Path) -> str:
    scene = item.scene or item.name
    viewer = gallery / scene / "scene.html"
    return FIGURE.format(
        video=escape(f"{item.name}/{made.video}"),
        title=escape(item.title),
        text=escape(item.text),
        viewer=escape(f"{scene}/scene.html"),
        scene=escape(f"{scene}/scene.safetensors"),
        seconds=made.seconds,
        memory=made.peak_memory_bytes / 1e9,
        scene_mb=made.scene_bytes / 1e6,
        viewer_mb=viewer.stat().st_size / 1e6,
    )
