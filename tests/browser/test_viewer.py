"""The page in a real browser: the same picture as our renderer, and controls that work.

Needs ``pip install playwright`` and a Chromium on the path; skipped without.
"""

import base64
import json
import math
import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from viewer_scenes import SIZE_PX, cloud, drawn_scenes, key_motion, scene

from diff4splat.io.cameras.path_files import read_path
from diff4splat.render.api import render
from diff4splat.scene.scene import Scene
from diff4splat.viewer.page import write_page

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path"),
]
SOFTWARE = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
MIN_PSNR_DB, WAIT_MS = 35.0, 120_000
READY = "window.diff4splat && window.diff4splat.isReady"


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield browser
        browser.close()


class Page:
    """One page, and what it complained about."""

    def __init__(self, browser: object, file: Path) -> None:
        self.complaints: list[str] = []
        self.tab = browser.new_page(viewport={"width": 700, "height": 500})
        self.tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.tab.on("console", self._listen)
        self.tab.goto(file.as_uri())
        self.wait()

    def _listen(self, message: object) -> None:
        if message.type == "error":
            self.complaints.append(message.text)

    def wait(self) -> None:
        self.tab.wait_for_function(READY, timeout=WAIT_MS)

    def run(self, script: str) -> object:
        return self.tab.evaluate(script)

    def image(self) -> np.ndarray:
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        self.wait()
        url = self.run("document.getElementById('view').toDataURL('image/png')")
        data = np.frombuffer(base64.b64decode(url.split(",")[1]), np.uint8)
        return cv2.imdecode(data, 1)[..., ::-1] / 255


def opened(browser: object, one: Scene, folder: Path) -> Page:
    write_page(one, folder / "scene.html")
    page = Page(browser, folder / "scene.html")
    page.run(f"diff4splat.setSize([{SIZE_PX[1]}, {SIZE_PX[0]}])")
    return page


@pytest.mark.parametrize("name", sorted(drawn_scenes()))
def test_the_page_shows_what_our_renderer_shows(browser: object, name: str, tmp_path: Path) -> None:
    one = drawn_scenes()[name]
    page = opened(browser, one, tmp_path)
    for frame in (0, 3, 5, 8):
        time_s = float(one.path.times_s[frame])
        page.run(f"diff4splat.showPath({time_s})")
        truth = render(one, one.path.cameras[frame], time_s).rgb.clamp(0, 1).numpy()
        error = float(np.square(page.image() - truth).mean())
        assert -10 * math.log10(error) > MIN_PSNR_DB, (name, frame)
    assert not page.complaints


@pytest.mark.parametrize("name", ["still", "key_frames"])
def test_a_larger_window_shows_what_our_renderer_shows_at_that_size(
    browser: object, name: str, tmp_path: Path
) -> None:
    one = drawn_scenes()[name]
    page = opened(browser, one, tmp_path)
    height, width = (2 * side for side in SIZE_PX)
    page.run(f"diff4splat.setSize([{width}, {height}]), diff4splat.showPath(0)")
    camera = one.path.cameras[0].resized((height, width))
    truth = render(one, camera, 0.0).rgb.clamp(0, 1).numpy()
    error = float(np.square(page.image() - truth).mean())
    assert -10 * math.log10(error) > MIN_PSNR_DB


def test_controls_change_the_picture(browser: object, tmp_path: Path) -> None:
    page = opened(browser, scene(cloud(800), key_motion(800)), tmp_path)
    seen = [page.image()]
    page.tab.locator("#time").fill("1")
    seen.append(page.image())
    page.tab.mouse.move(300, 200)
    page.tab.mouse.down()
    page.tab.mouse.move(380, 220)
    page.tab.mouse.up()
    seen.append(page.image())
    page.tab.mouse.wheel(0, 240)
    seen.append(page.image())
    for key in ("2", "3"):
        page.tab.keyboard.press(key)
        seen.append(page.image())
    for before, after in pairwise(seen):
        assert float(np.abs(before - after).max()) > 0.1
    page.tab.keyboard.press("1")
    page.tab.keyboard.press("0")
    page.tab.locator("#time").fill("0")
    np.testing.assert_allclose(page.image(), seen[0], atol=0.02)
    assert not page.complaints


def test_playing_ends_at_the_end_unless_it_repeats(browser: object, tmp_path: Path) -> None:
    page = opened(browser, scene(cloud(50), key_motion(50)), tmp_path)
    page.run("diff4splat.actions.loop(), diff4splat.actions.play()")
    page.tab.wait_for_function("!diff4splat.state.isPlaying", timeout=WAIT_MS)
    assert page.run("diff4splat.state.timeS") == 2


def test_a_recorded_path_can_be_rendered(browser: object, tmp_path: Path) -> None:
    one = scene(cloud(50), key_motion(50))
    page = opened(browser, one, tmp_path)
    page.run("diff4splat.actions.loop(), diff4splat.actions.follow(), diff4splat.actions.play()")
    page.run("diff4splat.recorder.start()")
    page.tab.wait_for_function("!diff4splat.state.isPlaying", timeout=WAIT_MS)
    page.image()
    recorded = page.run(f"diff4splat.recorder.stop([{SIZE_PX[1]}, {SIZE_PX[0]}])")
    (tmp_path / "camera_path.json").write_text(json.dumps(recorded))
    path = read_path(tmp_path / "camera_path.json", one.path.cameras[0])
    assert len(path) > 20 and path.cameras.size_px == SIZE_PX
    assert bool((path.times_s.diff() > 0).all())
    last = torch.tensor(recorded["camera_path"][-1]["camera_to_world"]).view(4, 4)
    last[:, 1:3] *= -1  # OpenGL's y and z
    truth = one.path.cameras.world_from_camera[-1]
    torch.testing.assert_close(last, truth, atol=1e-3, rtol=0)
    focal_px = one.path.cameras.focal_px[-1]
    torch.testing.assert_close(path.cameras.focal_px[-1], focal_px, rtol=1e-3, atol=0)


def test_a_hostile_prompt_does_not_run(browser: object, tmp_path: Path) -> None:
    prompt = "</script><img src=x onerror='window.hacked=1'><script>window.hacked=1</script>"
    page = opened(browser, scene(cloud(5), prompt=prompt), tmp_path)
    assert page.run("window.hacked") is None
    assert page.run("document.querySelector('#about strong').textContent") == prompt


def test_an_empty_scene_is_black(browser: object, tmp_path: Path) -> None:
    page = opened(browser, scene(cloud(1)), tmp_path)
    assert not page.complaints
    page = opened(browser, scene(cloud(0)), tmp_path)
    assert page.image().max() == 0
    assert not page.complaints
