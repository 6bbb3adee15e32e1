"""Views that lack one object: the same camera and exposure, and everything else where it was."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.renderer.without_objects import (
    LEAST_SHARE,
    MOST_SHARE,
    chosen_objects,
    draw_without_objects,
)
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.data_prep.writing import MOST_OBJECTS, WorldJob, write_worlds
from diff4splat.errors import ConfigError
from diff4splat.progress.phases import Phases
from diff4splat.training.batches.shadows.samples import views_without_object

RECIPE = WorldRecipe(seed=5, still_share=0.0, frames=2, size_px=(48, 48), views=1)
SETTINGS = DrawSettings(samples_per_side=2, tracks=0, flow=False, shadow_px=64)


@pytest.fixture(scope="module")
def clip():
    return draw_without_objects(make_world(RECIPE, 2), 3, SETTINGS)


def test_every_view_lacks_one_object_and_has_the_camera_of_the_first(clip) -> None:
    assert len(clip.views) == 4 and clip.frames == 1
    taken = views_without_object(clip)
    assert taken
    for at, mask in taken:
        view = clip.views[at]
        assert np.array_equal(
            view.cameras.world_from_camera, clip.views[0].cameras.world_from_camera
        )
        behind = view.depth[0][mask]
        assert bool(((behind == 0) | (behind >= clip.views[0].depth[0][mask] - 1e-4)).all())
        same = view.instances[0] == clip.views[0].instances[0]
        assert bool(same[~mask].all())


def test_far_from_the_object_colours_are_the_same(clip) -> None:
    for at, mask in views_without_object(clip):
        change = (clip.views[at].rgb[0].int() - clip.views[0].rgb[0].int()).abs().amax(-1)
        assert float((change[~mask] <= 1).double().mean()) > 0.5


def test_objects_are_taken_away_as_a_whole_and_alike_every_time() -> None:
    world = make_world(RECIPE, 2)
    instances = np.zeros((100, 100), np.uint8)
    notes = world.note.objects
    instances[:10, :10] = notes[0].instance
    number = notes[0].object_number
    parts = tuple(one.instance for one in notes if number and one.object_number == number)
    assert chosen_objects(world, instances, 3) == [parts or (notes[0].instance,)]
    assert chosen_objects(world, instances, 0) == []


@pytest.mark.parametrize("share", [LEAST_SHARE / 2, MOST_SHARE * 1.1])
def test_objects_that_are_too_small_or_too_large_stay(share: float) -> None:
    world = make_world(RECIPE, 2)
    instances = np.zeros(10_000, np.uint8)
    instances[: round(share * 10_000)] = world.note.objects[0].instance
    assert chosen_objects(world, instances.reshape(100, 100), 3) == []


def test_a_job_writes_them_and_goes_on(tmp_path: Path) -> None:
    job = WorldJob(folder=tmp_path, clips=1, recipe=RECIPE, draw=SETTINGS, without_objects=2)
    assert write_worlds(job, Phases()) == 1
    assert write_worlds(replace(job, clips=2), Phases(), append=True) == 1
    found = ClipFolder(tmp_path)
    assert len(found) == 2
    assert len(found.clip(0).views) == 3
    other = replace(job, without_objects=1)
    with pytest.raises(ConfigError, match=r"\(1, 2, \(48, 48\)\)"):
        write_worlds(other, Phases(), append=True)


@pytest.mark.parametrize("count", [-1, MOST_OBJECTS + 1])
def test_impossible_numbers_are_refused(count: int, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--without-objects from 0 to 7"):
        WorldJob(folder=tmp_path, clips=1, recipe=RECIPE, without_objects=count)
