"""Frames of a path, one at a time: what is kept, what shows nothing, and what a run will need."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from filmed_scenes import filmed_scene

from diff4splat.errors import ConfigError
from diff4splat.outputs import filming, run_estimate
from diff4splat.outputs.filming import FilmRecord, empty_note, film
from diff4splat.outputs.run_estimate import estimate_frames, estimate_generation, require_fits
from diff4splat.outputs.scene_folder import write_view
from diff4splat.paths.camera_path import CameraPath
from diff4splat.progress.run_log import RunLog
from diff4splat.render.api import render, render_video
from diff4splat.scene.scene import Scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return filmed_scene(frames=12, size_px=(12, 16), side=9)


def turned(scene: Scene, right: float) -> CameraPath:
    """The path of the scene, ``right`` units further to the right in its last frame."""
    poses = scene.path.cameras.world_from_camera.clone()
    poses[-1, 0, 3] += right
    return replace(scene.path, cameras=replace(scene.path.cameras, world_from_camera=poses))


def test_frames_are_those_of_the_renderer_and_only_some_are_kept(scene: Scene) -> None:
    record = FilmRecord(path=scene.path)
    shown = list(film(scene, record, RunLog()))
    want = list(render_video(scene, scene.path, outputs=("rgb", "depth")))
    for got, frame in zip(shown, want, strict=True):
        assert torch.equal(got, frame.rgb)
    assert torch.equal(record.depth, torch.stack([frame.depth for frame in want]))
    assert record.sheet_index.tolist() == [0, 3, 6, 8, 11]
    assert len(record.sheet_rgb) == 5
    assert torch.equal(record.sheet_rgb[2], want[6].rgb.clamp(0, 1))
    assert torch.equal(record.first_rgb, want[0].rgb.clamp(0, 1))


def test_no_frame_is_rendered_before_it_is_asked_for(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    rendered = []

    def counting(*arguments: object, **options: object) -> Iterator:
        for frame in render_video(*arguments, **options):
            rendered.append(1)
            yield frame

    monkeypatch.setattr(filming, "render_video", counting)
    record = FilmRecord(path=scene.path, with_depth=False)
    frames = film(scene, record, RunLog())
    next(frames), next(frames)
    assert len(rendered) == 2
    assert record.depth is None
    frames.close()


def test_one_line_says_how_much_of_a_frame_shows_nothing(scene: Scene, tmp_path: Path) -> None:
    inside = FilmRecord(path=scene.path, with_depth=False)
    list(film(scene, inside, RunLog()))
    assert empty_note(scene, inside) is None
    path = turned(scene, 6.0)
    outside = FilmRecord(path=path, with_depth=False)
    list(film(scene, outside, RunLog()))
    at = float(path.times_s[-1])
    alpha = render(scene, path.cameras[-1], at, outputs=("alpha",)).alpha
    share = float((alpha < 0.5).float().mean())
    assert share > 0.3
    assert f"nothing shows in up to {share:.0%} of the frame (frame 11)" in empty_note(
        scene, outside
    )
    notes = write_view(scene, path, tmp_path / "view.webm", None, RunLog())
    assert any("the path leaves the scene" in note for note in notes)


def test_what_the_first_view_lacks_itself_is_no_news(scene: Scene) -> None:
    path = turned(scene, 6.0)
    last = replace(path, cameras=path.cameras[-1:], times_s=path.times_s[-1:])
    alone = replace(scene, path=last)
    record = FilmRecord(path=last, with_depth=False)
    list(film(alone, record, RunLog()))
    assert record.empty_share > 0.3
    assert empty_note(alone, record) is None


def test_needs_grow_with_frames_and_size() -> None:
    few, many = (estimate_frames(count, (200, 300), True) for count in (10, 1000))
    assert many.memory_bytes - few.memory_bytes == 990 * 200 * 300 * 12
    assert many.disk_bytes == pytest.approx(100 * few.disk_bytes)
    assert estimate_frames(1000, (200, 300), False).memory_bytes == few.memory_bytes - 10 * 720_000
    assert estimate_generation(10, (200, 300), True).seconds > few.seconds
    assert "1,000 frames of 300×200: about 60 s on two cores, 1.2 GB of memory" in str(many)


def test_what_cannot_fit_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_estimate, "free_memory_bytes", lambda: 8_000_000_000)
    monkeypatch.setattr(run_estimate, "free_disk_bytes", lambda _: 1_000_000_000)
    with pytest.raises(ConfigError, match=r"at most 8\.0 GB of memory.*need of 74\.2 GB; fewer"):
        require_fits(estimate_frames(100_000, (192, 320), True), tmp_path, "fewer --frames")
    with pytest.raises(ConfigError, match=r"at most 1\.0 GB of disk.*need of 1\.8 GB; fewer"):
        require_fits(estimate_frames(100_000, (192, 320), False), tmp_path, "fewer --frames")
    assert require_fits(estimate_frames(49, (192, 320), True), tmp_path, "") is None
    long = require_fits(estimate_frames(9_000, (192, 320), False), tmp_path, "")
    assert long == "9,000 frames of 320×192: about 9 min on two cores, 0.5 GB of memory and " + (
        "0.2 GB of disk"
    )


def test_free_space_is_known_before_a_folder_exists(tmp_path: Path) -> None:
    free = run_estimate.free_disk_bytes(tmp_path / "not" / "there")
    assert free is not None
    assert free > 0
    assert run_estimate.free_memory_bytes() is None or run_estimate.free_memory_bytes() > 1e6


def test_frames_of_another_device_come_back_to_the_cpu(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A device that computes nothing: only where tensors go is looked at."""
    moved: list[torch.device] = []

    def to(self: Scene, target: torch.device) -> Scene:
        moved.append(target)
        return self

    monkeypatch.setattr(Scene, "to", to)
    record = FilmRecord(path=scene.path, device="cuda:0")
    frames = list(film(scene, record, RunLog()))
    assert moved == [torch.device("cuda:0")]
    assert all(frame.device.type == "cpu" for frame in (*frames, record.depth, record.first_rgb))
