"""What a clip must be before anything is written or learned from it."""

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from oracles_clips import make_clip

from diff4splat.data.checks import require_first_camera, require_valid_clip
from diff4splat.data.clip import Clip, Tracks, View
from diff4splat.errors import InputError


@pytest.mark.parametrize(
    "clip",
    [make_clip(), make_clip(frames=1, views=1, tracks=0), make_clip(static=True, views=3)],
)
def test_whole_clips_pass(clip: Clip) -> None:
    require_valid_clip(clip, least_depth_share=0.5)
    require_first_camera(clip)


def noted(**fields: object) -> Callable[[Clip], Clip]:
    return lambda clip: replace(clip, note=replace(clip.note, **fields))


def timed(*times: float) -> Callable[[Clip], Clip]:
    return lambda clip: replace(clip, times_s=torch.tensor(times, dtype=torch.float64))


def viewed(change: Callable[[View], View]) -> Callable[[Clip], Clip]:
    """In the second view."""
    return lambda clip: replace(clip, views=(clip.views[0], change(clip.views[1])))


def tracked(change: Callable[[Tracks], Tracks]) -> Callable[[Clip], Clip]:
    return lambda clip: replace(clip, tracks=change(clip.tracks))


def with_one(values: torch.Tensor, number: float) -> torch.Tensor:
    changed = values.clone()
    changed.view(-1)[5] = number
    return changed


def posed(change: Callable[[torch.Tensor], torch.Tensor]) -> Callable[[Clip], Clip]:
    def apply(view: View) -> View:
        return replace(view, cameras=view.cameras.with_pose(change(view.cameras.world_from_camera)))

    return viewed(apply)


def flowed(change: Callable[..., object]) -> Callable[[Clip], Clip]:
    return viewed(lambda view: replace(view, flow=change(view.flow)))


def lens(view: View, number: float) -> View:
    focal_px = with_one(view.cameras.focal_px, number)
    return replace(view, cameras=replace(view.cameras, focal_px=focal_px))


TWICE = make_clip().note.objects[:1] * 2
WRONG = [
    (noted(identifier="a.b"), "identifier: expected up to 80 letters"),
    (noted(identifier=""), "identifier: expected up to 80 letters"),
    (noted(license=""), "note: expected a source and a license, got an empty one"),
    (noted(objects=TWICE), "objects: expected different instances from 1 to 255, got [1, 1]"),
    (timed(0, 1, 1, 2, 3), "times_s: expected finite times that increase"),
    (timed(0, 1, float("nan"), 2, 3), "times_s: expected finite times that increase"),
    (timed(), "times_s: expected 1 to 10000 frames, got 0"),
    (timed(0, 1, 2), "view 0, rgb: expected uint8 of shape (3, 24, 32, 3), got uint8 of shape (5,"),
    (lambda c: replace(c, times_s=c.times_s.float()), "times_s: expected float64 of shape (5,)"),
    (viewed(lambda v: replace(v, rgb=v.rgb.float())), "view 1, rgb: expected uint8 of shape"),
    (viewed(lambda v: replace(v, depth=v.depth.double())), "view 1, depth: expected float32"),
    (
        viewed(lambda v: replace(v, depth=v.depth[1:])),
        "view 1, depth: expected float32 of shape (5",
    ),
    (viewed(lambda v: replace(v, depth=-v.depth)), "depth: expected finite depth, 0 for none"),
    (viewed(lambda v: replace(v, depth=with_one(v.depth, torch.inf))), "expected finite depth"),
    (viewed(lambda v: replace(v, instances=v.instances.long())), "instances: expected uint8 of"),
    (
        viewed(lambda v: replace(v, cameras=v.cameras.to(torch.float32))),
        "cameras: expected float64",
    ),
    (
        viewed(lambda v: replace(v, cameras=v.cameras[1:])),
        "cameras: expected float64 of shape (5, 4",
    ),
    (viewed(lambda v: lens(v, 0.0)), "cameras: expected finite intrinsics and focal lengths above"),
    (viewed(lambda v: lens(v, torch.nan)), "cameras: expected finite intrinsics"),
    (posed(lambda p: with_one(p, torch.nan)), "cameras: expected finite numbers, got NaN"),
    (posed(lambda p: with_one(p, 1.001)), "cameras: expected rotations without scale or shear"),
    (posed(lambda p: p * torch.tensor([[1.0], [1], [1], [2]]).double()), "0 0 0 1 as the last row"),
    (
        posed(lambda p: p * torch.tensor([-1.0, 1, 1, 1]).double()),
        "expected right-handed rotations",
    ),
    (flowed(lambda f: replace(f, to_next=f.to_next.half())), "flow: expected float32 of shape (4,"),
    (flowed(lambda f: replace(f, known=f.known[1:])), "flow.known: expected bool of shape (4, 24,"),
    (flowed(lambda f: replace(f, visible=f.visible.byte())), "flow.visible: expected bool"),
    (
        flowed(lambda f: replace(f, to_next=f.to_next / 0)),
        "view 1, flow: expected finite flow where it is known, got NaN or infinity",
    ),
    (
        flowed(lambda f: replace(f, visible=~f.known)),
        "view 1, flow: expected known flow where it is visible",
    ),
    (
        viewed(lambda v: replace(v, track_uv=None)),
        "view 1: expected tracks with both uv and visible",
    ),
    (lambda c: replace(c, tracks=None), "view 0: expected tracks with both uv and visible"),
    (
        viewed(lambda v: replace(v, track_uv=v.track_uv[:, 1:])),
        "track_uv: expected float32 of shape",
    ),
    (viewed(lambda v: replace(v, track_uv=v.track_uv / 0)), "view 1, track_uv: expected finite"),
    (
        viewed(lambda v: replace(v, track_visible=v.track_visible[1:])),
        "track_visible: expected bool",
    ),
    (
        tracked(lambda t: replace(t, positions=t.positions[1:])),
        "positions: expected float32 of shape",
    ),
    (
        tracked(lambda t: replace(t, positions=t.positions / 0)),
        "positions: expected finite numbers",
    ),
    (tracked(lambda t: replace(t, found_at=t.found_at + 5)), "found_at: expected (view, frame) of"),
    (tracked(lambda t: replace(t, found_at=t.found_at - 9)), "found_at: expected (view, frame) of"),
    (
        tracked(lambda t: replace(t, found_at=t.found_at * 0 + 2)),
        "found_at: expected (view, frame)",
    ),
    (tracked(lambda t: replace(t, found_at=t.found_at.float())), "found_at: expected int64"),
    (lambda c: replace(c, views=c.views + make_clip(size_px=(24, 33)).views), "view 2: expected"),
    (lambda c: replace(c, views=c.views * 51), "views: expected 1 to 100, got 102"),
]


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(("change", "says"), WRONG, ids=[says[:40] for _, says in WRONG])
def test_one_line_says_what_is_wrong(change: Callable[[Clip], Clip], says: str) -> None:
    broken = change(make_clip())
    with pytest.raises(InputError) as caught:
        require_valid_clip(broken)
    text = str(caught.value)
    assert text.startswith(f"clip '{broken.note.identifier}', ")
    assert says in text
    assert "\n" not in text


def test_unknown_flow_may_be_anything() -> None:
    clip = make_clip(views=1)
    flow = clip.views[0].flow
    flow.to_next[~flow.known] = torch.nan
    require_valid_clip(clip)


def test_a_clip_of_sky_is_told_apart_on_demand() -> None:
    clip = make_clip(views=1)
    empty = replace(clip, views=(replace(clip.views[0], depth=torch.zeros(5, 24, 32)),))
    require_valid_clip(empty)
    with pytest.raises(
        InputError, match=r"depth: expected some in 1% of all pixels or more, got 0"
    ):
        require_valid_clip(empty, least_depth_share=0.01)


def test_the_world_is_the_first_camera() -> None:
    clip = make_clip()
    with pytest.raises(InputError, match="expected the identity as its first pose, got a diff"):
        require_first_camera(replace(clip, views=clip.views[::-1]))
