"""Hostile prompts, lost graphics, old browsers, files that are damaged or too large."""

from pathlib import Path

import numpy as np
import pytest
from viewer_page import Page, opened
from viewer_scenes import cloud, key_motion, scene

from diff4splat.viewer import payload
from diff4splat.viewer.page import write_page, write_page_or_reason

pytestmark = pytest.mark.browser
PROMPT = "</script><img src=x onerror='window.hacked=1'><script>window.hacked=1</script>{{SCRIPT}}"


def test_a_hostile_prompt_does_not_run(browser: object, tmp_path: Path) -> None:
    page = opened(browser, scene(cloud(5), prompt=PROMPT), tmp_path)
    assert page.run("window.hacked") is None
    assert page.run("document.querySelector('#about strong').textContent") == PROMPT
    assert page.run("document.title") == PROMPT


def test_the_page_may_neither_run_other_code_nor_use_a_network(
    browser: object, tmp_path: Path
) -> None:
    page = opened(browser, scene(cloud(5)), tmp_path)
    assert [url for url in page.requests if not url.startswith(("file:", "blob:"))] == []
    page.run(
        "const added = document.createElement('script'); added.textContent = 'window.hacked = 1';"
        "document.body.append(added);"
    )
    assert page.run("window.hacked") is None
    for url in ("https://example.org", "data:,x"):
        assert page.run(f"fetch('{url}').then(() => 'sent', () => 'refused')") == "refused"
    assert all("Content Security Policy" in complaint for complaint in page.complaints)
    assert len(page.complaints) >= 3


def test_graphics_that_were_taken_away_come_back(browser: object, tmp_path: Path) -> None:
    page = opened(browser, scene(cloud(300), key_motion(300)), tmp_path)
    page.run("diff4splat.actions.setTime(1)")
    before = page.image()
    page.run("window.taken = diff4splat.renderer.gl.getExtension('WEBGL_lose_context')")
    page.run("taken.loseContext()")
    page.until("document.getElementById('message').textContent.includes('taken away')")
    page.run("taken.restoreContext()")
    page.until("!diff4splat.renderer.gl.isContextLost()")
    np.testing.assert_allclose(page.image(), before, atol=0.02)
    assert page.run("diff4splat.renderer.gl.getError()") == 0
    assert not page.complaints


def test_without_webgl_2_the_page_says_what_to_do(browser: object, tmp_path: Path) -> None:
    write_page(scene(cloud(5)), tmp_path / "scene.html")
    none = "HTMLCanvasElement.prototype.getContext = () => null"
    page = Page(browser, tmp_path / "scene.html", before=none)
    assert "WebGL 2" in page.message and "hardware acceleration" in page.message
    assert not page.complaints


def test_too_many_gaussians_for_the_device_are_said(browser: object, tmp_path: Path) -> None:
    write_page(scene(cloud(1500)), tmp_path / "scene.html")
    small = "WebGL2RenderingContext.prototype.getParameter = () => 1"
    page = Page(browser, tmp_path / "scene.html", before=small)
    assert "1,500 Gaussians are too many" in page.message
    assert not page.complaints


def test_a_page_for_a_scene_that_is_too_large_says_so(
    browser: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(payload, "MAX_BYTES", 1000)
    write_page_or_reason(scene(cloud(100)), tmp_path / "scene.html")
    page = Page(browser, tmp_path / "scene.html")
    assert "100 Gaussians" in page.message and "fewer" in page.message
    assert not page.complaints


def test_a_damaged_file_says_so(browser: object, tmp_path: Path) -> None:
    write_page(scene(cloud(50)), tmp_path / "scene.html")
    text = (tmp_path / "scene.html").read_text()
    start = text.index('id="payload">') + len('id="payload">')
    (tmp_path / "scene.html").write_text(text[: start + 40] + "AAAA" + text[start + 44 :])
    page = Page(browser, tmp_path / "scene.html")
    assert page.message.startswith("The scene cannot be shown")
    assert not page.complaints
