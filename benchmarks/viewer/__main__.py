"""What the viewer's page costs in headless Chromium with software rendering.

Run ``python -m benchmarks.viewer``; it needs ``pip install -e .[browser]`` and a Chromium on the
path. Every start is in a fresh browser; several pages take turns, so that their ratio holds
on a busy machine, too.

    size      of the HTML file
    start     from the navigation to the first sorted frame, read back
    CPU       of all processes of the browser in that time
    sort      of one frame in the page's worker, the camera turned before each, nothing drawn
"""

import argparse
import os
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory

from benchmarks.viewer.browser import chromium, opened
from benchmarks.viewer.scenes import KEYS, moving_scene
from diff4splat.viewer.page import write_page

WINDOW_PX = (600, 960)
SORT = """async ({ rounds }) => {
  const found = [], { camera, actions, renderer } = diff4splat;
  // Drawing in software would take the sort's core.
  renderer.render = () => {};
  const next = () => new Promise((done) => requestAnimationFrame(done));
  for (let round = 0; round < rounds; round++) {
    camera.orbit(0.02, 0.005);
    actions.redraw();
    do await next(); while (!diff4splat.isReady);
    found.push(diff4splat.sortMilliseconds);
  }
  return found;
}"""


def main() -> None:
    """A table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--sorts", type=int, default=100)
    parser.add_argument("pages", type=Path, nargs="*", help="compare the start of these pages")
    options = parser.parse_args()
    with TemporaryDirectory() as name:
        pages = options.pages or [_page(60_000, Path(name))]
        _print_starts(pages, options.rounds)
        if not options.pages:
            _print_sorts(_page(400_000, Path(name)), options.sorts)


def _page(count: int, folder: Path) -> Path:
    file = folder / f"{count // 1000}k.html"
    write_page(moving_scene(count), file)
    return file


def _print_starts(pages: list[Path], rounds: int) -> None:
    starts, cpus = {page: [] for page in pages}, {page: [] for page in pages}
    for _ in range(rounds):
        for page in pages:
            with chromium() as browser:
                _, start_s, cpu_s = opened(browser, page, WINDOW_PX)
            starts[page].append(start_s)
            cpus[page].append(cpu_s)
    print(f"half of the Gaussians move, {KEYS} key times; load {os.getloadavg()[0]:.1f}\n")
    print("| page | size, MB | start, s: least, median | CPU, s: least, median |")
    print("|---|---:|---:|---:|")
    for page in pages:
        size = page.stat().st_size / 1e6
        print(f"| {page.stem} | {size:.2f} | {_least(starts[page])} | {_least(cpus[page])} |")


def _print_sorts(page: Path, rounds: int) -> None:
    with chromium() as browser:
        tab, start_s, cpu_s = opened(browser, page, WINDOW_PX)
        milliseconds = tab.evaluate(SORT, {"rounds": rounds})
    size = page.stat().st_size / 1e6
    print(f"| {page.stem} | {size:.2f} | {start_s:.2f} | {cpu_s:.2f} |\n")
    print(f"sort of {page.stem}, ms: least, median, 90 %: {_least(milliseconds)}, ", end="")
    print(f"{quantiles(milliseconds, n=10)[-1]:.2f}; load {os.getloadavg()[0]:.1f}")


def _least(values: list[float]) -> str:
    return f"{min(values):.2f}, {median(values):.2f}"


if __name__ == "__main__":
    main()
