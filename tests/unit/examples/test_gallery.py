"""The gallery keeps what is finished, goes on after failures and escapes what it shows."""

from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from examples.gallery import make as making
from examples.gallery.items import DIFF4SPLAT, ITEMS, Item
from examples.gallery.make import ItemError, finished, make, make_all
from examples.gallery.page import write_page

PROGRAM = """
import pathlib, sys
out = pathlib.Path(sys.argv[1])
if "fail" in sys.argv:
    sys.exit("no")
for name in ("video.webm", "scene.safetensors", "scene.html"):
    (out / name).write_text("x" * 1000)
"""
ITEM = Item(
    name="a", group="Group", title="<b>“A” & co</b>", text="t", steps=((DIFF4SPLAT, "{out}"),)
)


@pytest.fixture(autouse=True)
def _program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "PROGRAMS", {DIFF4SPLAT: ("-c", PROGRAM)})


def test_a_finished_item_is_kept_and_a_changed_one_is_made_again(tmp_path: Path) -> None:
    first = make(ITEM, tmp_path)
    assert first.scene_bytes == 1000 and first.video == "video.webm"
    assert first.peak_memory_bytes > 2**20
    (tmp_path / "a" / "mark").touch()
    assert make(ITEM, tmp_path) == first and (tmp_path / "a" / "mark").exists()
    make(replace(ITEM, steps=((DIFF4SPLAT, "{out}", "more"),)), tmp_path)
    assert not (tmp_path / "a" / "mark").exists()
    (tmp_path / "a" / "item.json").write_text("{")
    assert finished(ITEM, tmp_path / "a") is None


def test_a_failure_leaves_the_others(tmp_path: Path) -> None:
    broken = replace(ITEM, name="b", steps=((DIFF4SPLAT, "{out}", "fail"),))
    with pytest.raises(ItemError, match=r"see .*log\.txt"):
        make(broken, tmp_path)
    reported: list[str] = []
    assert list(make_all([broken, ITEM], tmp_path, reported.append)) == ["a"]
    assert (
        reported[0] == "1/2 b"
        and "left out" in reported[1]
        and reported[2].startswith("2/2 a, about")
    )
    assert make_all([ITEM], tmp_path, reported.append) and reported[-1] == "1/1 a (kept)"


def test_the_page_names_only_files_beside_it(tmp_path: Path) -> None:
    page = write_page([ITEM], {"a": make(ITEM, tmp_path)}, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "<b>" not in text and "&lt;b&gt;“A” &amp; co" in text and "://" not in text
    found: list[str] = []
    parser = HTMLParser()
    parser.handle_starttag = lambda tag, attrs: found.extend(
        value for name, value in attrs if name in ("src", "href")
    )
    parser.feed(text)
    assert len(found) == 3 and all((tmp_path / name).is_file() for name in found)


def test_the_items_are_a_dozen_with_names_of_their_own() -> None:
    names = [item.name for item in ITEMS]
    assert len(ITEMS) == len(set(names)) == 12
    assert all(names.index(item.scene) < names.index(item.name) for item in ITEMS if item.scene)
    assert {step[0] for item in ITEMS for step in item.steps} == {
        *("photo", "world picture", DIFF4SPLAT),
    }
