"""Clips in model units."""

from dataclasses import replace

import pytest
import torch
from oracles_clips import make_clip

from diff4splat.errors import InputError
from diff4splat.geometry.camera import project
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.normalise_scale import normalized, rescaled


def test_the_first_input_frame_gets_the_depth_of_the_photographs_plane() -> None:
    depth = normalized(make_clip()).views[0].depth[0]
    assert float(depth[depth > 0].median()) == pytest.approx(PLANE_DEPTH, rel=1e-6)


@pytest.mark.parametrize("factor", [1e-3, 1.0, 250.0])
def test_scaling_lengths_changes_no_image(factor: float) -> None:
    clip = make_clip(tracks=16)
    scaled = rescaled(clip, factor)
    for before, after in zip(clip.views, scaled.views, strict=True):
        assert after.track_uv is not None and before.track_uv is not None
        for frame in range(clip.frames):
            points = scaled.tracks.positions[frame].double()
            pixels, depth = project(after.cameras[frame], points)
            seen = before.track_visible[frame]
            torch.testing.assert_close(
                pixels[seen].float(), before.track_uv[frame][seen].float(), atol=1e-2, rtol=0
            )
            assert bool((depth[seen] > 0).all())


def test_rotations_and_lenses_stay() -> None:
    clip = make_clip()
    before, after = clip.views[1].cameras, rescaled(clip, 3.0).views[1].cameras
    assert torch.equal(before.world_from_camera[:, :3, :3], after.world_from_camera[:, :3, :3])
    assert torch.equal(before.focal_px, after.focal_px)
    torch.testing.assert_close(before.position * 3, after.position)


@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf"), -1.0])
def test_a_clip_without_depth_is_named(value: float) -> None:
    clip = make_clip()
    first = replace(clip.views[0], depth=torch.full_like(clip.views[0].depth, value))
    with pytest.raises(InputError, match=r"clip-0: expected depth in at least 1% .* got 0.0%"):
        normalized(replace(clip, views=(first, *clip.views[1:])))
