"""The page: nothing of a scene leaves its place, and what cannot be kept is said."""

import base64
import gzip
import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from viewer_scenes import cloud, drawn_scenes, key_motion, scene

from benchmarks.viewer.scenes import moving_scene
from diff4splat.errors import InputError
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion
from diff4splat.viewer import payload
from diff4splat.viewer.keyframed import MAX_KEYS, keyframed
from diff4splat.viewer.page import page, script, write_page
from diff4splat.viewer.payload import pack_scene

MAX_SCRIPT_BYTES = 40_000
HOSTILE = "</script><script>alert(1)</script>{{SCRIPT}}<!--\u2028'\"&amp;\x00"


def element(text: str, name: str) -> str:
    return re.search(rf'id="{name}">(.*?)</script>', text, re.DOTALL)[1]


def header_of(text: str) -> dict:
    return json.loads(element(text, "header"))


def test_a_prompt_cannot_leave_its_place() -> None:
    text = page(keyframed(scene(cloud(10), prompt=HOSTILE)))
    assert header_of(text)["about"]["title"] == HOSTILE
    assert text.count("<script") == page(keyframed(scene(cloud(10)))).count("<script")
    assert "alert(1)</script>" not in text


def test_the_script_is_small() -> None:
    assert len(script().encode()) < MAX_SCRIPT_BYTES


def test_the_page_needs_no_network() -> None:
    text = page(keyframed(scene(cloud(10))))
    assert not re.search(r"https?:|//[a-z]+\.[a-z]|<link|src=", text)


def test_the_policy_names_the_script_and_the_style_and_nothing_else() -> None:
    text = page(keyframed(scene(cloud(10), prompt=HOSTILE)))
    rules = dict(
        rule.split(" ", 1)
        for rule in re.search(r'Security-Policy" content="(.*?)"', text)[1].split("; ")
    )
    code = re.search(r"<script>(.*?)</script>", text, re.DOTALL)[1]
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL)[1]
    for rule, content in (("script-src", code), ("style-src", style)):
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert rules.pop(rule) == f"'sha256-{digest}'"
    assert rules.pop("worker-src") == "blob:"
    assert set(rules.values()) == {"'none'"}


def test_half_of_60000_gaussians_moving_fit_into_4_mb() -> None:
    assert len(page(keyframed(moving_scene(60_000)))) < 4_000_000


def test_what_stands_costs_nothing_per_key_time() -> None:
    def size(keys: int) -> int:
        motion = key_motion(30, keys=keys)
        return sum(len(data) for _, data in pack_scene(scene(cloud(30), motion)).sections)

    assert size(5) - size(2) == 3 * 10 * 19


def test_a_scene_that_is_too_large_is_refused_and_nothing_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(payload, "MAX_BYTES", 23 * 99)
    with pytest.raises(InputError, match="100 Gaussians"):
        write_page(scene(cloud(100)), tmp_path / "scene.html")
    assert not list(tmp_path.iterdir())
    write_page(scene(cloud(99)), tmp_path / "scene.html")


def test_sections_are_as_long_as_the_header_says() -> None:
    for name, one in drawn_scenes().items():
        text = page(keyframed(one))
        header = header_of(text)
        data = gzip.decompress(base64.b64decode(element(text, "payload")))
        assert sum(length for _, length in header["sections"]) == len(data), name
        assert header["count"] == len(one.gaussians)
        moving = getattr(one.motion, "moving_index", torch.zeros(0))
        assert header["moving"] == len(moving)


def test_gaussians_that_move_come_first() -> None:
    one = scene(cloud(30), key_motion(30))
    packed = dict(pack_scene(one).sections)
    planes = np.frombuffer(packed["means"], np.uint8).reshape(3, -1)
    raw = np.zeros((planes.shape[1], 4), np.uint8)
    raw[:, 1:] = planes.T
    means = torch.from_numpy(raw.view("<f4")[:, 0].reshape(-1, 3).copy())
    torch.testing.assert_close(means[:10], one.gaussians.means[::3], rtol=1e-4, atol=1e-6)


def test_what_nobody_sees_is_left_out() -> None:
    gaussians = cloud(30)
    gaussians.opacities[:6] = 0.001
    packed = pack_scene(scene(gaussians, key_motion(30))).header
    assert (packed["count"], packed["moving"]) == (24, 8)


def test_equal_scenes_give_equal_pages() -> None:
    one = scene(cloud(50), key_motion(50, turning=True))
    assert page(keyframed(one)) == page(keyframed(one))


@pytest.mark.parametrize("count", [0, 1])
def test_scenes_of_no_or_one_gaussian(count: int) -> None:
    assert header_of(page(keyframed(scene(cloud(count)))))["count"] == count


def test_too_many_key_times_are_thinned_and_it_is_said() -> None:
    motion = key_motion(9)
    many = replace(
        motion,
        key_times_s=torch.linspace(0, 2, 400),
        offsets=torch.zeros(400, 3, 3),
        rotations=torch.tensor([1.0, 0, 0, 0]).expand(400, 3, 4).clone(),
        log_scale_offsets=torch.zeros(400, 3, 3),
    )
    ready = keyframed(scene(cloud(9), many))
    assert len(ready.scene.motion.key_times_s) == MAX_KEYS
    assert "256 of 400" in ready.notes[0]


def test_key_frames_of_nothing_are_static() -> None:
    motion = key_motion(9).select(torch.zeros(9, dtype=torch.bool))
    assert isinstance(motion, KeyframeMotion)
    assert isinstance(keyframed(scene(cloud(9), motion)).scene.motion, StaticMotion)


def test_motion_of_another_kind_is_baked_and_the_error_said(tmp_path: Path) -> None:
    from diff4splat.io.scene_files.scene_file import load_scene

    golden = Path(__file__).parents[2] / "golden" / "scene_v1_spacetime.safetensors"
    written = write_page(load_scene(golden), tmp_path / "page.html")
    assert "px off" in written.notes[0] and "opacity" in written.notes[1]
    assert header_of((tmp_path / "page.html").read_text())["about"]["notes"] == list(written.notes)
