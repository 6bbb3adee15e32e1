"""What people do with the page: mouse, fingers, keys, buttons; and paths that they record."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from viewer_page import Page, eventually, opened
from viewer_scenes import SIZE_PX, cloud, key_motion, scene

from diff4splat.io.cameras.path_files import read_path
from diff4splat.viewer.page import write_page

pytestmark = pytest.mark.browser
ROOM = {"viewport": {"width": 700, "height": 500}}
CAMERA = "[diff4splat.camera.rows, diff4splat.camera.position].flat(2)"


@pytest.fixture
def page(browser: object, tmp_path: Path) -> Page:
    return opened(browser, scene(cloud(200), key_motion(200)), tmp_path, **ROOM)


def pose(page: Page) -> np.ndarray:
    page.wait()
    return np.array(page.run(CAMERA))


def drag(page: Page, button: str = "left") -> None:
    page.tab.mouse.move(300, 200)
    page.tab.mouse.down(button=button)
    page.tab.mouse.move(380, 220, steps=2)
    page.tab.mouse.up(button=button)


def test_controls_change_the_picture(page: Page) -> None:
    seen = [page.image()]
    page.tab.locator("#time").fill("1")
    seen.append(page.image())
    drag(page)
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


def test_orbit_pan_zoom_and_fly_do_what_they_are_called(page: Page) -> None:
    focus = "diff4splat.camera.focus"
    start, point = pose(page), np.array(page.run(focus))
    drag(page)  # orbit: the same point stays in the middle, at the same distance
    orbited = pose(page)
    np.testing.assert_allclose(page.run(focus), point, atol=1e-9)
    assert np.abs(orbited[:9] - start[:9]).max() > 0.05
    drag(page, "right")  # pan: turns nothing
    panned = pose(page)
    np.testing.assert_allclose(panned[:9], orbited[:9], atol=1e-12)
    distance = page.run("diff4splat.camera.distance")
    page.tab.mouse.wheel(0, -240)
    assert eventually(lambda: page.run("diff4splat.camera.distance") < distance)
    forward, before = np.array(page.run("diff4splat.camera.rows"))[:, 2], pose(page)[9:]
    page.tab.keyboard.down("w")
    assert eventually(lambda: np.dot(page.run(CAMERA)[9:] - before, forward) > 0.01)
    page.tab.keyboard.up("w")


def test_keys_orbit_zoom_and_step(page: Page) -> None:
    for key in ("Shift+ArrowLeft", "Shift+ArrowUp", "+", "-"):
        before = pose(page)
        page.tab.keyboard.press(key)
        assert np.abs(pose(page) - before).max() > 1e-3, key
    page.tab.keyboard.press("ArrowRight")
    assert page.run("diff4splat.state.timeS") == pytest.approx(2 / 48)
    page.tab.keyboard.press("u")
    assert not page.tab.locator("#panel").is_visible()


def test_space_plays_after_a_button_was_clicked(page: Page) -> None:
    page.tab.locator("#loop").click()
    page.until("document.activeElement === document.body")
    page.tab.keyboard.press(" ")
    assert page.run("[diff4splat.state.isPlaying, diff4splat.state.loops]") == [True, False]


def test_fingers_orbit_and_pinch(browser: object, tmp_path: Path) -> None:
    phone = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True}
    page = opened(browser, scene(cloud(50)), tmp_path, **phone)
    session = page.tab.context.new_cdp_session(page.tab)

    def touch(kind: str, *points: tuple[int, int]) -> None:
        places = [{"x": x, "y": y, "id": place} for place, (x, y) in enumerate(points)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

    before = pose(page)
    touch("touchStart", (150, 300))
    touch("touchMove", (220, 300))
    touch("touchEnd")
    assert np.abs(pose(page) - before).max() > 0.05
    distance = page.run("diff4splat.camera.distance")
    touch("touchStart", (150, 300), (200, 300))
    touch("touchMove", (100, 300), (250, 300))
    touch("touchEnd")
    assert page.run("diff4splat.camera.distance") < 0.5 * distance
    # Every control is inside of the window or can be scrolled to.
    assert page.run("document.documentElement.scrollWidth") <= 390


def test_dark_and_light(page: Page) -> None:
    paper = "getComputedStyle(document.documentElement).getPropertyValue('--paper')"
    found = []
    for scheme in ("light", "dark"):
        page.tab.emulate_media(color_scheme=scheme)
        found.append(page.run(paper))
    page.tab.keyboard.press("t")
    assert page.run(paper) == found[0] != found[1]


def test_what_moves_plays_by_itself_along_its_path(browser: object, tmp_path: Path) -> None:
    one = scene(cloud(50), key_motion(50))
    write_page(one, tmp_path / "scene.html")
    page = Page(browser, tmp_path / "scene.html", reduced_motion="no-preference", **ROOM)
    page.until("window.diff4splat?.state.isPlaying && diff4splat.state.timeS > 0")
    drag(page)
    assert page.run("[diff4splat.state.isPlaying, diff4splat.state.follows]") == [True, False]


def test_playing_ends_at_the_end_unless_it_repeats(page: Page) -> None:
    page.run("diff4splat.state.speed = 2, diff4splat.actions.loop(), diff4splat.actions.play()")
    page.until("!diff4splat.state.isPlaying")
    assert page.run("diff4splat.state.timeS") == 2
    page.run("diff4splat.actions.play()")
    assert page.run("diff4splat.state.timeS") < 2


def test_a_recorded_path_can_be_rendered(browser: object, tmp_path: Path) -> None:
    one = scene(cloud(50), key_motion(50))
    page = opened(browser, one, tmp_path)
    page.run("diff4splat.actions.loop(), diff4splat.actions.follow(), diff4splat.actions.play()")
    page.tab.keyboard.press("r")
    page.until("!diff4splat.state.isPlaying")
    page.image()
    with page.tab.expect_download() as download:
        page.tab.keyboard.press("r")
    assert download.value.suggested_filename == "camera_path.json"
    download.value.save_as(tmp_path / "camera_path.json")
    recorded = json.loads((tmp_path / "camera_path.json").read_text())
    path = read_path(tmp_path / "camera_path.json", one.path.cameras[0])
    assert len(path) > 20 and path.cameras.size_px == SIZE_PX
    assert bool((path.times_s.diff() > 0).all())
    last = torch.tensor(recorded["camera_path"][-1]["camera_to_world"]).view(4, 4)
    last[:, 1:3] *= -1  # OpenGL's y and z
    truth = one.path.cameras.world_from_camera[-1]
    torch.testing.assert_close(last, truth, atol=1e-3, rtol=0)
    focal_px = one.path.cameras.focal_px[-1]
    torch.testing.assert_close(path.cameras.focal_px[-1], focal_px, rtol=1e-3, atol=0)
