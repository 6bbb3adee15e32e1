"""The viewer's page in Chromium, and everything that it complained about."""

import math
import time
from pathlib import Path

import cv2
import numpy as np
import torch
from viewer_scenes import SIZE_PX

from diff4splat.scene.scene import Scene
from diff4splat.viewer.page import write_page

WAIT_MS = 120_000
READY = "() => window.diff4splat?.isReady"
WINDOW = {"width": SIZE_PX[1], "height": SIZE_PX[0]}
"""In which the page shows the scene at its own size."""


class Page:
    """One tab with the page of a scene; nothing plays by itself."""

    def __init__(self, browser: object, file: Path, before: str = "", **options: object) -> None:
        options = {"viewport": WINDOW, "reduced_motion": "reduce"} | options
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.tab = browser.new_page(**options)
        self.tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.tab.on("console", self._listen)
        self.tab.on("request", lambda request: self.requests.append(request.url))
        if before:
            self.tab.add_init_script(before)
        self.tab.goto(file.as_uri())

    def _listen(self, message: object) -> None:
        if message.type == "error":
            self.complaints.append(message.text)

    def until(self, condition: str) -> None:
        """Wait for an expression; the page's policy forbids what the browser's own wait does."""
        self.tab.wait_for_function(f"() => {condition}", timeout=WAIT_MS)

    def wait(self) -> None:
        self.tab.wait_for_function(READY, timeout=WAIT_MS)

    def run(self, script: str) -> object:
        return self.tab.evaluate(script)

    @property
    def message(self) -> str:
        self.until("!document.getElementById('message').textContent.startsWith('Reading')")
        return self.tab.locator("#message").text_content()

    def image(self) -> np.ndarray:
        """A screenshot of the window without panels, in [0, 1]."""
        self.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        self.wait()
        self.run("document.body.classList.add('bare')")
        data = np.frombuffer(self.tab.screenshot(), np.uint8)
        self.run("document.body.classList.remove('bare')")
        return cv2.imdecode(data, 1)[..., ::-1] / 255


def opened(browser: object, one: Scene, folder: Path, **options: object) -> Page:
    """The page of a scene, ready."""
    write_page(one, folder / "scene.html")
    page = Page(browser, folder / "scene.html", **options)
    page.wait()
    return page


def psnr_db(image: np.ndarray, truth: torch.Tensor) -> float:
    error = float(np.square(image - truth.clamp(0, 1).numpy()).mean())
    return -10 * math.log10(max(error, 1e-10))


def eventually(condition: object, seconds: float = 60) -> bool:
    """Whether a call becomes true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False
