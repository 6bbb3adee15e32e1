"""The page in a real browser: the same picture as our renderer."""

from pathlib import Path

import numpy as np
import pytest
from viewer_page import opened, psnr_db
from viewer_scenes import SIZE_PX, cloud, drawn_scenes, key_motion, scene

from diff4splat.render.api import render

pytestmark = pytest.mark.browser
MIN_PSNR_DB = 35.0


@pytest.mark.parametrize("name", sorted(drawn_scenes()))
def test_the_page_shows_what_our_renderer_shows(browser: object, name: str, tmp_path: Path) -> None:
    one = drawn_scenes()[name]
    page = opened(browser, one, tmp_path)
    for frame in (0, 3, 5, 8):
        time_s = float(one.path.times_s[frame])
        page.run(f"diff4splat.showPath({time_s})")
        truth = render(one, one.path.cameras[frame], time_s).rgb
        assert psnr_db(page.image(), truth) > MIN_PSNR_DB, (name, frame)
    assert not page.complaints


@pytest.mark.parametrize("name", ["still", "key_frames"])
def test_a_larger_window_shows_what_our_renderer_shows_at_that_size(
    browser: object, name: str, tmp_path: Path
) -> None:
    one = drawn_scenes()[name]
    height, width = (2 * side for side in SIZE_PX)
    page = opened(browser, one, tmp_path, viewport={"width": width, "height": height})
    camera = one.path.cameras[0].resized((height, width))
    assert psnr_db(page.image(), render(one, camera, 0.0).rgb) > MIN_PSNR_DB


def test_harmonics_of_every_degree_have_a_program(browser: object, tmp_path: Path) -> None:
    for degree in (1, 2):
        one = scene(cloud(300, degree=degree))
        page = opened(browser, one, tmp_path)
        truth = render(one, one.path.cameras[0], 0.0).rgb
        assert psnr_db(page.image(), truth) > MIN_PSNR_DB, degree
        assert not page.complaints


@pytest.mark.parametrize("count", [0, 1])
def test_scenes_of_no_or_one_gaussian(browser: object, count: int, tmp_path: Path) -> None:
    one = scene(cloud(count), key_motion(count) if count else None)
    page = opened(browser, one, tmp_path)
    image = page.image()
    assert psnr_db(image, render(one, one.path.cameras[0], 0.0).rgb) > MIN_PSNR_DB
    for key in ("2", "3", "Shift+ArrowLeft", "-", "0", "p"):
        page.tab.keyboard.press(key)
        page.wait()
    assert page.run(
        "[diff4splat.camera.rows, diff4splat.camera.position, diff4splat.camera.distance]"
        ".flat(2).every(Number.isFinite)"
    )
    assert not page.complaints


def test_one_far_outlier_does_not_spoil_the_order(browser: object, tmp_path: Path) -> None:
    gaussians = cloud(1500)
    gaussians.means[0] = gaussians.means.new_tensor([0.0, 0.0, 1e7])
    one = scene(gaussians)
    page = opened(browser, one, tmp_path)
    assert psnr_db(page.image(), render(one, one.path.cameras[0], 0.0).rgb) > MIN_PSNR_DB


def test_depth_and_motion_have_their_own_colours_and_a_legend(
    browser: object, tmp_path: Path
) -> None:
    page = opened(browser, scene(cloud(900), key_motion(900)), tmp_path)
    page.run("diff4splat.actions.setTime(1)")
    images = [page.image()]
    for button in ("depth", "motion"):
        page.run(f"document.getElementById('{button}').click()")
        images.append(page.image())
        assert page.tab.locator("#legend").is_visible()
    # Depth has no grey, what stands in motion has nothing else.
    spread = [np.ptp(image, axis=-1) for image in images]
    lit = [image.max(-1) > 0.5 for image in images]
    assert np.median(spread[1][lit[1]]) > 0.4
    assert (spread[2] < 0.02).mean() > 0.2 and (spread[2] > 0.4).mean() > 0.05
    assert "displacement" in page.tab.locator("#unit").text_content()
