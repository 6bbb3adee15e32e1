"""Images of cutouts as a folder of clips."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.cutouts.write import COUNTS, CutoutJob, write_cutouts
from diff4splat.errors import ConfigError, InputError, OutputError
from diff4splat.progress.phases import Phases


@pytest.fixture
def job(tmp_path: Path) -> CutoutJob:
    cutouts, photographs = tmp_path / "cutouts", tmp_path / "photographs"
    cutouts.mkdir(), photographs.mkdir()
    for name, color in (("a", "red"), ("b", "blue"), ("c", "green")):
        Image.new("RGBA", (30, 20), color).save(cutouts / f"{name}.png")
    levels = np.random.default_rng(0).integers(0, 256, (40, 50, 3), dtype=np.uint8)
    Image.fromarray(levels).save(photographs / "wall.png")
    names = tmp_path / "names.json"
    names.write_text(json.dumps({"a": "apple", "b": "cat", "c": "cat"}))
    return CutoutJob(
        cutouts=cutouts,
        names=names,
        photographs=photographs,
        folder=tmp_path / "out",
        license="MIT",
        images=6,
        size_px=32,
    )


def test_images_are_clips_with_notes_of_their_objects(job: CutoutJob) -> None:
    assert write_cutouts(job, Phases()) == 6
    folder = ClipFolder(job.folder)
    assert len(folder) == 6
    for index in range(6):
        clip = folder.clip(index)
        view, notes = clip.views[0], clip.note.objects
        assert clip.size_px == (32, 32) and clip.frames == 1 and view.depth is None
        assert 1 <= len(notes) <= max(COUNTS) and clip.note.license == "MIT"
        assert {note.name for note in notes} <= {"apple", "cat"}
        assert set(view.instances.unique().tolist()) <= {0, *(note.instance for note in notes)}


def test_every_image_is_another(job: CutoutJob) -> None:
    write_cutouts(replace(job, images=20), Phases())
    clips = [ClipFolder(job.folder).clip(index) for index in range(20)]
    assert len({clip.views[0].rgb.numpy().tobytes() for clip in clips}) == 20
    nouns = [note.name for clip in clips for note in clip.note.objects]
    assert 8 < nouns.count("apple") < 20 and 8 < nouns.count("cat") < 20


def test_a_stopped_run_goes_on_with_the_same_images(job: CutoutJob) -> None:
    write_cutouts(replace(job, images=3), Phases())
    with pytest.raises(OutputError, match="append"):
        write_cutouts(job, Phases())
    assert write_cutouts(job, Phases(), append=True) == 3
    whole = replace(job, folder=job.folder.with_name("whole"))
    write_cutouts(whole, Phases())
    for index in range(6):
        one, other = (ClipFolder(folder).clip(index) for folder in (job.folder, whole.folder))
        assert one.note == other.note
        assert bool((one.views[0].rgb == other.views[0].rgb).all())


def test_nothing_to_paste_on_is_refused(job: CutoutJob, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="photographs"):
        write_cutouts(replace(job, photographs=tmp_path / "empty"), Phases())
    assert not job.folder.exists()
    with pytest.raises(ConfigError, match="at least 1 image"):
        replace(job, images=0)
