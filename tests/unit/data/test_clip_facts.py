"""What a source does not tell stays absent, in memory and in shards; old shards still load."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from oracles_clip_equality import first_difference
from oracles_clips import make_clip

from diff4splat.data.checks import require_valid_clip
from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.clip_part import ClipPart
from diff4splat.data.codecs.encode import Coding
from diff4splat.data.scale_record import ScaleRecord
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import InputError

OLD = Path(__file__).parents[2] / "golden" / "clips_v1"
SCALE = ScaleRecord(
    method="disparity ransac irls", factor=0.5, disparity_scale=2.0, disparity_shift=-0.1
)


def real_clip() -> Clip:
    """Sparse facts: one view without depth, points that come and go, masks of sky and motion."""
    clip = make_clip(views=2)
    known = torch.rand(clip.tracks.positions.shape[:2], generator=torch.Generator().manual_seed(3))
    known = known > 0.3
    first, second = (
        replace(view, instances=None, flow=None, track_visible=view.track_visible & known)
        for view in clip.views
    )
    first = replace(first, sky=first.depth == 0, moving=first.depth > 5)
    note = replace(
        clip.note, dataset="toy", scene="toy-1", timed=False, track_source="estimated", scale=SCALE
    )
    tracks = replace(clip.tracks, instances=None, known=known)
    views = (first, replace(second, depth=None))
    return Clip(note=note, times_s=clip.times_s, views=views, tracks=tracks)


def stored(folder: Path, clip: Clip, **part: Any) -> Clip:
    options = ShardOptions(generator="test 1", coding=Coding(depth="float"))
    with ShardWriter(folder, options) as writer:
        writer.write(clip)
    return ClipFolder(folder).clip(0, ClipPart(**part))


def test_every_fact_comes_back(tmp_path: Path) -> None:
    clip = real_clip()
    assert first_difference(stored(tmp_path, clip), clip) is None
    entry = ClipFolder(tmp_path).entries[0]
    assert (entry.dataset, entry.scene, entry.fps, entry.layers) == ("toy", "toy-1", None, ())
    assert (entry.motion, entry.commercial_ok) == ("tracks", True)


def test_masks_are_read_by_frame_and_on_demand(tmp_path: Path) -> None:
    clip = real_clip()
    part = stored(tmp_path, clip, frames=(1, 3), flow=False)
    assert torch.equal(part.views[0].moving, clip.views[0].moving[[1, 3]])
    assert torch.equal(part.tracks.known, clip.tracks.known[[1, 3]])
    assert ClipFolder(tmp_path).clip(0, ClipPart(masks=False)).views[0].sky is None


def test_a_member_that_the_manifest_promises_must_be_there(tmp_path: Path) -> None:
    clip = make_clip()
    assert stored(tmp_path, clip).fps == pytest.approx(12)
    assert ClipFolder(tmp_path).entries[0].layers == ("depth", "instances", "flow")
    assert ClipFolder(tmp_path).entries[0].motion == "objects"


def test_absent_masks_do_not_mean_stillness() -> None:
    moving, still = make_clip(), make_clip(static=True)
    bare = replace(moving.views[0], instances=None)
    assert moving.motion_truth == "objects"
    assert replace(moving, views=(bare,)).motion_truth == "tracks"
    assert replace(moving, tracks=None).motion_truth == "unknown"
    assert still.motion_truth == "static"


@pytest.mark.parametrize("path", ["as it is", "appended to"])
def test_folders_of_version_1_still_load(tmp_path: Path, path: str) -> None:
    for file in OLD.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    if path == "appended to":
        with ShardWriter(tmp_path, ShardOptions(generator="test 2"), append=True) as writer:
            writer.write(make_clip(2, (8, 10), seed=7))
    clips = ClipFolder(tmp_path)
    assert [entry.motion for entry in clips.entries[:2]] == ["objects", "static"]
    for place, want in enumerate(
        (
            make_clip(2, (8, 10), views=2, tracks=6),
            make_clip(2, (8, 10), views=1, static=True, seed=1, tracks=0),
        )
    ):
        found = clips.clip(place)
        pairs = zip(found.views, want.views, strict=True)
        views = tuple(replace(mine, depth=theirs.depth) for mine, theirs in pairs)
        assert first_difference(replace(found, views=views), want) is None


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"factor": 0.0}, "scale, factor: expected a number above 0"),
        ({"normaliser": float("nan")}, "scale, normaliser: expected a finite number"),
        ({"method": ""}, "scale, method: expected the name of a method"),
    ],
)
def test_scale_records_must_make_sense(change: dict[str, Any], says: str) -> None:
    clip = make_clip()
    note = replace(clip.note, scale=replace(SCALE, **change))
    with pytest.raises(InputError, match=says):
        require_valid_clip(replace(clip, note=note))


def test_what_is_visible_is_known() -> None:
    clip = make_clip()
    tracks = replace(clip.tracks, known=torch.zeros(clip.tracks.positions.shape[:2]).bool())
    with pytest.raises(InputError, match="expected visible points to be known"):
        require_valid_clip(replace(clip, tracks=tracks))
