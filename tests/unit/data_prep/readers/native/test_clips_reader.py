"""Our own clips as captures: every view a camera, depth and flow as they are stored."""

from pathlib import Path

import pytest
import torch
from clip_shards import exact_clip, write_shards
from oracles_clips import make_clip

from diff4splat.data.capture.split import report_split
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.readers.options import ReadOptions
from diff4splat.data_prep.readers.registry import detect_format, read_capture
from diff4splat.errors import ConfigError, FileFormatError, InputError
from diff4splat.geometry.camera import project
from diff4splat.geometry.depth import unproject


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), still=1, moving=2)


def write_one(folder: Path, **make) -> Path:
    with ShardWriter(folder, ShardOptions(generator="oracle 1")) as writer:
        writer.write(make_clip(**make))
    return folder


def test_every_view_is_a_camera_and_the_last_is_held_out(folder: Path) -> None:
    assert detect_format(folder) == "clips"
    capture = read_capture(folder, ReadOptions(clip="clip-1"))
    clip = exact_clip(1, static=False)
    assert capture.camera_index.tolist() == [0] * 5 + [1] * 5
    assert torch.equal(capture.held_out, capture.camera_index == 1)
    assert torch.equal(capture.times_s, clip.times_s.repeat(2))
    assert (capture.name, capture.license) == ("clip-1", "CC0-1.0")
    assert capture.split_reason == "the last view held out, by default"
    assert report_split(capture).held_out == 5
    for index in (0, 4, 5, 9):
        view, time = clip.views[index // 5], index % 5
        frame = capture.frames.read(index)
        torch.testing.assert_close(frame.rgb, view.rgb[time] / 255)
        torch.testing.assert_close(frame.depth, view.depth[time], rtol=2e-5, atol=0)
        torch.testing.assert_close(
            capture.cameras.world_from_camera[index], view.cameras.world_from_camera[time]
        )


def test_flow_goes_to_the_next_frame_of_the_same_camera(folder: Path) -> None:
    capture = read_capture(folder, ReadOptions(clip="clip-2"))
    clip = exact_clip(2, static=False)
    for index in range(10):
        flow = capture.frames.read(index).flow
        if index % 5 == 4:
            assert flow is None
            continue
        assert flow.to_frame == index + 1
        stored = clip.views[index // 5].flow
        assert torch.equal(flow.known, stored.known[index % 5])
        torch.testing.assert_close(
            flow.offset_px[flow.known], stored.to_next[index % 5][flow.known]
        )


@pytest.mark.parametrize("downscale", [1, 2])
def test_flow_is_what_a_still_scene_seen_from_elsewhere_gives(folder: Path, downscale: int) -> None:
    capture = read_capture(folder, ReadOptions(clip="clip-0", downscale=downscale))
    frame, here, there = capture.frames.read(1), capture.cameras[1], capture.cameras[2]
    points = unproject(here, frame.depth.double())
    at = project(there, points.reshape(-1, 3))[0].reshape(*frame.depth.shape, 2)
    height, width = frame.depth.shape
    row, column = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    offset_px = at - torch.stack([column, row], -1) - 0.5
    off = (offset_px - frame.flow.offset_px).norm(dim=-1)[frame.flow.known & (frame.depth > 0)]
    assert len(off) > 100
    # Blocks across an edge have the depth of one side and the mean flow of both.
    assert float(off.median()) < (1e-3 if downscale == 1 else 2e-2)


def test_downscaling_keeps_what_is_seen_where_it_is(folder: Path) -> None:
    full = read_capture(folder, ReadOptions(clip="clip-1"))
    half = read_capture(folder, ReadOptions(clip="clip-1", downscale=2))
    assert half.cameras.size_px == (16, 16)
    torch.testing.assert_close(half.cameras.focal_px * 2, full.cameras.focal_px)
    rgb = full.frames.read(3).rgb.reshape(16, 2, 16, 2, 3).mean((1, 3))
    torch.testing.assert_close(half.frames.read(3).rgb, rgb)
    with pytest.raises(ConfigError, match="a downscale of at most 32, got 33"):
        read_capture(folder, ReadOptions(clip="clip-1", downscale=33))


def test_every_second_time_has_no_flow(folder: Path) -> None:
    capture = read_capture(folder, ReadOptions(clip="clip-1", frame_step=2))
    clip = exact_clip(1, static=False)
    assert torch.equal(capture.times_s, clip.times_s[::2].repeat(2))
    frame = capture.frames.read(4)
    assert frame.flow is None
    torch.testing.assert_close(frame.rgb, clip.views[1].rgb[2] / 255)


def test_the_clip_has_to_be_named_where_there_are_several(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"since the folder has 3; choose one \(clip-0, clip-1"):
        read_capture(folder)
    with pytest.raises(ConfigError, match="did you mean 'clip-1'"):
        read_capture(folder, ReadOptions(clip="clip-11"))
    assert read_capture(write_one(tmp_path)).name == "clip-0"


def test_one_view_misses_every_eighth_time(tmp_path: Path) -> None:
    capture = read_capture(write_one(tmp_path, frames=10, views=1, tracks=0))
    assert capture.held_out.nonzero().flatten().tolist() == [0, 8]
    assert "every 8th time" in capture.split_reason


def test_other_views_can_be_held_out(tmp_path: Path) -> None:
    write_one(tmp_path, views=3)
    capture = read_capture(tmp_path, ReadOptions(hold_out=(0, 2)))
    assert torch.equal(capture.held_out, capture.camera_index != 1)
    with pytest.raises(ConfigError, match="expected cameras from 0 to 2"):
        read_capture(tmp_path, ReadOptions(hold_out=(3,)))
    assert not bool(read_capture(tmp_path, ReadOptions(hold_out=())).held_out.any())


def test_a_damaged_shard_is_refused(tmp_path: Path) -> None:
    write_one(tmp_path)
    (tmp_path / "shard-00000.tar").write_bytes(b"x")
    with pytest.raises(FileFormatError, match="expected a shard of"):
        read_capture(tmp_path)


def test_a_frame_that_is_not_there_is_refused(folder: Path) -> None:
    frames = read_capture(folder, ReadOptions(clip="clip-1")).frames
    for index in (-1, 10):
        with pytest.raises(InputError, match=f"frame: expected 0 to 9, got {index}"):
            frames.read(index)
