"""Exact clips agree with themselves; every usual mistake of a reader is caught by a check."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from oracles_clips import make_clip

from diff4splat.data.clip import Clip, View
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.consistency.check import (
    MEASURED,
    Consistency,
    Tolerances,
    measure_consistency,
    require_consistency,
)
from diff4splat.data.consistency.static_pixels import static_instances
from diff4splat.data.consistency.statistics import ErrorStatistics, TrueFraction
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.errors import InputError
from diff4splat.geometry.depth import distance_from_depth

FIGURES = tuple(Consistency.__slots__)


def of_views(change: Callable[[View], View]) -> Callable[[Clip], Clip]:
    return lambda clip: replace(clip, views=tuple(change(view) for view in clip.views))


def of_poses(change: Callable[[torch.Tensor], torch.Tensor]) -> Callable[[Clip], Clip]:
    def apply(view: View) -> View:
        poses = change(view.cameras.world_from_camera.clone())
        return replace(view, cameras=view.cameras.with_pose(poses))

    return of_views(apply)


def axis_turned(*signs: float) -> Callable[[Clip], Clip]:
    return of_poses(lambda poses: poses @ torch.diag(torch.tensor([*signs, 1.0]).double()))


def transposed(poses: torch.Tensor) -> torch.Tensor:
    poses[:, :3, :3] = poses[:, :3, :3].mT.clone()
    return poses


def scaled(poses: torch.Tensor) -> torch.Tensor:
    poses[:, :3, :3] *= 1.01
    return poses


def along_the_ray(view: View) -> View:
    return replace(view, depth=distance_from_depth(view.cameras, view.depth.double()).float())


def centers_at_integers(view: View) -> View:
    return replace(view, cameras=replace(view.cameras, center_px=view.cameras.center_px - 0.5))


def tracks_at_integers(view: View) -> View:
    return replace(view, track_uv=view.track_uv - 0.5)


def flow_a_frame_late(view: View) -> View:
    return replace(view, flow=replace(view.flow, to_next=view.flow.to_next.roll(1, 0)))


def flow_backwards(view: View) -> View:
    return replace(view, flow=replace(view.flow, to_next=-view.flow.to_next))


def tracks_a_frame_late(view: View) -> View:
    return replace(view, track_uv=view.track_uv.roll(1, 0))


def everything_visible(view: View) -> View:
    return replace(view, track_visible=torch.ones_like(view.track_visible))


def nothing_visible(view: View) -> View:
    return replace(view, track_visible=torch.zeros_like(view.track_visible))


def first_view(change: Callable[[View], View]) -> Callable[[Clip], Clip]:
    return lambda clip: replace(clip, views=(change(clip.views[0]), *clip.views[1:]))


def depth_scaled(view: View) -> View:
    return replace(view, depth=view.depth * 1.1)


def found_in_the_other_view(clip: Clip) -> Clip:
    found_at = clip.tracks.found_at.clone()
    found_at[:, 0] = 1 - found_at[:, 0]
    return replace(clip, tracks=replace(clip.tracks, found_at=found_at))


def broken_figures(clip: Clip, tolerances: Tolerances) -> set[str]:
    """By the definitions, not by ``require_consistency``."""
    limits = {"rotation": 1e-5, "found_depth": tolerances.depth, "reprojection": 0.02}
    broken, figures = set(), measure_consistency(clip)
    for name in FIGURES:
        figure = getattr(figures, name)
        if isinstance(figure, TrueFraction) and figure.share < tolerances.share:
            broken.add(name)
        if isinstance(figure, ErrorStatistics):
            value = figure.median if name == "reprojection" else figure.max
            if value > limits.get(name, tolerances.pixels):
                broken.add(name)
    return broken


@pytest.mark.parametrize("static", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_exact_clips_agree(seed: int, static: bool) -> None:
    figures = require_consistency(make_clip(seed=seed, static=static, views=3))
    for name in FIGURES:
        figure = getattr(figures, name)
        assert figure.count > 0
        if isinstance(figure, TrueFraction):
            assert figure.share > 0.99
        else:
            assert figure.median < 1e-5
    assert figures.flow_px.max < 1e-5
    assert figures.projection_px.max < 1e-4
    assert figures.found_depth.max < 1e-6


def test_stored_clips_agree(tmp_path: Path) -> None:
    with ShardWriter(tmp_path, ShardOptions(generator="test 1")) as writer:
        writer.write(make_clip())
    figures = require_consistency(ClipFolder(tmp_path).clip(0))
    assert 0 < figures.found_depth.max <= 2.0**-16 * 1.01


MISTAKES = {
    "mirrored x": (axis_turned(-1.0, 1.0, 1.0), {"rotation", "projection_px", "flow_px"}),
    "y and z turned": (axis_turned(1.0, -1.0, -1.0), {"projection_px", "found_depth"}),
    "x and y turned": (axis_turned(-1.0, -1.0, 1.0), {"projection_px", "flow_px"}),
    "rotation transposed": (of_poses(transposed), {"projection_px", "flow_px"}),
    "camera_from_world": (of_poses(torch.linalg.inv), {"projection_px", "flow_px"}),
    "rotation scaled": (of_poses(scaled), {"rotation"}),
    "ray length": (of_views(along_the_ray), {"found_depth"}),
    "depth in other units": (of_views(depth_scaled), {"found_depth", "flow_px"}),
    "integer centres": (of_views(centers_at_integers), {"projection_px"}),
    "tracks at integer centres": (of_views(tracks_at_integers), {"found_pixel_px"}),
    "flow of the frame before": (of_views(flow_a_frame_late), {"flow_px", "found_flow_px"}),
    "flow backwards": (of_views(flow_backwards), {"flow_px", "found_flow_px"}),
    "tracks of the frame before": (of_views(tracks_a_frame_late), {"projection_px"}),
    "hidden tracks visible": (of_views(everything_visible), {"visible_depth"}),
    "visible tracks hidden": (of_views(nothing_visible), {"found_visible"}),
    "one view in other units": (first_view(depth_scaled), {"across_views", "found_depth"}),
    "found in the other view": (found_in_the_other_view, {"found_pixel_px", "found_depth"}),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_usual_mistakes_are_caught(name: str) -> None:
    mistake, figures = MISTAKES[name]
    broken = mistake(make_clip(seed=1, tracks=64))
    found = broken_figures(broken, Tolerances())
    assert figures <= found
    with pytest.raises(InputError) as caught:
        require_consistency(broken)
    text = str(caught.value)
    assert text.startswith("clip 'clip-1': ")
    assert text.split(": ")[1] in found, "the figure it names is a broken one"
    assert "expected at" in text
    assert "comparisons; look for" in text
    assert "\n" not in text


@pytest.mark.parametrize("name", ["rotation transposed", "camera_from_world", "y and z turned"])
def test_depth_alone_catches_wrong_poses(name: str) -> None:
    clip = make_clip(static=True, tracks=0, frames=9)
    bare = replace(clip, views=tuple(replace(view, flow=None) for view in clip.views))
    require_consistency(bare)
    assert broken_figures(MISTAKES[name][0](bare), Tolerances()) & {"reprojection", "across_views"}


def test_depth_of_one_view_catches_cameras_that_move_backwards() -> None:
    clip = make_clip(static=True, tracks=0, frames=9, views=1)
    bare = replace(clip, views=(replace(clip.views[0], flow=None),))
    assert require_consistency(bare).reprojection.median < 1e-6
    backwards = of_poses(torch.linalg.inv)(bare)
    assert broken_figures(backwards, Tolerances()) == {"reprojection"}


def test_measured_data_may_be_rough() -> None:
    clip = make_clip(tracks=64)
    noisy = of_views(
        lambda view: replace(view, depth=view.depth * (1 + 0.01 * torch.randn(view.depth.shape)))
    )(clip)
    require_consistency(noisy, MEASURED)
    with pytest.raises(InputError, match=r"found_depth: expected at most 0\.0001"):
        require_consistency(noisy)


def test_nothing_to_compare_is_none() -> None:
    clip = make_clip(views=1, tracks=0, frames=1)
    bare = replace(clip.views[0], flow=None, instances=None, depth=torch.zeros(1, 24, 32))
    figures = require_consistency(replace(clip, views=(bare,)))
    assert [name for name in FIGURES if getattr(figures, name) is not None] == ["rotation"]


def test_sky_alone_says_nothing() -> None:
    clip = make_clip(static=True, tracks=0)
    empty = of_views(lambda view: replace(view, depth=torch.zeros_like(view.depth)))(clip)
    figures = require_consistency(empty)
    assert figures.reprojection is figures.flow_px is figures.across_views is None


def test_tracks_of_unknown_origin_are_compared_where_they_are_seen() -> None:
    clip = make_clip()
    unknown = replace(clip.tracks, found_at=torch.full_like(clip.tracks.found_at, -1))
    figures = require_consistency(replace(clip, tracks=unknown))
    assert figures.found_depth is figures.found_visible is None
    assert figures.projection_px.count > 0


def test_numbers_that_are_none_count_as_the_worst() -> None:
    clip = make_clip()
    broken = first_view(lambda v: replace(v, track_uv=torch.full_like(v.track_uv, torch.nan)))
    with pytest.raises(InputError, match="got inf"):
        require_consistency(broken(clip))


def test_what_stands_still() -> None:
    clip = make_clip()
    assert static_instances(clip) == {1, 3}
    silent = replace(clip, note=replace(clip.note, objects=()))
    assert static_instances(silent) == {1, 3}, "by the tracks"
    assert static_instances(replace(silent, tracks=None)) == set()
    figures = measure_consistency(replace(silent, tracks=None))
    assert figures.reprojection is figures.flow_px is None


def test_moving_pixels_do_not_spoil_what_stands_still() -> None:
    """With everything called still, the box shows."""
    clip = make_clip()
    wrong = replace(clip, note=replace(clip.note, is_static=True))
    assert measure_consistency(wrong).flow_px.max > 0.1
    assert measure_consistency(clip).flow_px.max < 1e-5
