"""Chromium with software rendering, and what its processes cost."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SOFTWARE = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
WAIT_MS = 120_000
# A pixel is read because drawing commands return before the picture is there.
READY = """() => {
  if (!window.diff4splat?.isReady) return false;
  const { gl } = diff4splat.renderer;
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  return performance.now();
}"""


@contextmanager
def chromium() -> Iterator[object]:
    """A fresh browser, without anything kept from the last one."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=program, args=list(SOFTWARE))
        yield browser
        browser.close()


def opened(browser: object, file: Path, size_px: tuple[int, int]) -> tuple[object, float, float]:
    """The page of ``file``, and the seconds and CPU seconds until its first sorted frame.

    ``size_px`` is (height, width) of the window.
    """
    tab = browser.new_page(
        viewport={"width": size_px[1], "height": size_px[0]}, reduced_motion="reduce"
    )
    before = cpu_seconds()
    tab.goto(file.as_uri())
    ready_ms = tab.wait_for_function(READY, timeout=WAIT_MS).json_value()
    return tab, ready_ms / 1000, cpu_seconds() - before


def cpu_seconds() -> float:
    """CPU time of all processes that descend from this one, without this one."""
    parents, ticks = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue  # it has just ended
        pid = int(stat.parent.name)
        parents[pid], ticks[pid] = int(fields[1]), int(fields[11]) + int(fields[12])
    own = {os.getpid()}
    while found := {pid for pid, parent in parents.items() if parent in own} - own:
        own |= found
    return sum(ticks.get(pid, 0) for pid in own - {os.getpid()}) / os.sysconf("SC_CLK_TCK")
