"""Clips seen otherwise stay exact: tracks project to where they are seen."""

from collections.abc import Callable

import pytest
import torch
from oracles_clips import make_clip

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.geometry.camera import project
from diff4splat.training.batches.augment import cropped, led_by, mirrored, reversed_in_time
from diff4splat.training.batches.targets import visible_cells


def windowed(clip: Clip) -> Clip:
    return cropped(clip, (12, 16), torch.Generator().manual_seed(1))


@pytest.mark.parametrize("change", [mirrored, reversed_in_time, lambda c: led_by(c, 1), windowed])
def test_tracks_project_to_where_they_are_seen(change: Callable[[Clip], Clip]) -> None:
    clip = change(make_clip(tracks=40))
    for view in clip.views:
        pixels, z = project(view.cameras, clip.tracks.positions.double())
        seen = view.track_visible
        assert bool(seen.any())
        torch.testing.assert_close(pixels[seen].float(), view.track_uv[seen], atol=1e-2, rtol=0)
        assert bool((z[seen] > 0).all())
        column, row = view.track_uv[seen].unbind(-1)
        height, width = view.cameras.size_px
        assert bool(((column >= 0) & (column < width) & (row >= 0) & (row < height)).all())
    first = clip.views[0].cameras.world_from_camera[0]
    torch.testing.assert_close(first, torch.eye(4, dtype=first.dtype))
    frame, row, column = visible_cells(clip)[:, 1:].unbind(-1)
    assert bool((clip.views[0].instances[frame, row, column] > 0).all())


def test_twice_is_not_at_all() -> None:
    clip = make_clip()
    for change in (mirrored, reversed_in_time):
        again = change(change(clip))
        assert torch.equal(again.views[1].rgb, clip.views[1].rgb)
        torch.testing.assert_close(again.times_s, clip.times_s)


def test_a_window_larger_than_the_images_is_refused() -> None:
    with pytest.raises(InputError, match="expected images of at least 25×32, got 24×32"):
        cropped(make_clip(), (25, 32), torch.Generator())
