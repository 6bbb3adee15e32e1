"""Random shapes get a noun that no training shows, in captions and notes alike."""

import json
from pathlib import Path

from benchmarks.unseen_objects import renamed, write_renamed
from diff4splat.captions.grammar import parse_caption
from diff4splat.captions.vocabulary import UNNAMED, UNSEEN_NOUNS
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.synthetic.renderer.settings import DrawSettings
from diff4splat.data_prep.synthetic.worlds import WorldRecipe, make_world
from diff4splat.data_prep.writing import WorldJob, write_worlds
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.progress.phases import Phases

RECIPE = WorldRecipe(
    seed=4, still_share=0.0, frames=3, views=1, size_px=(32, 32), composite_share=1.0
)


def test_captions_and_notes_have_the_same_unseen_noun() -> None:
    for index in range(4):
        before = make_world(RECIPE, index).note
        after = renamed(before)
        names = {one.name for one in after.objects}
        facts = parse_caption(after.caption)
        said = {event.subject.noun for event in facts.events}
        assert UNNAMED not in names | said
        had_shapes = UNNAMED in {one.name for one in before.objects}
        assert len(names & set(UNSEEN_NOUNS)) == had_shapes
        assert len(facts.events) == len(parse_caption(before.caption).events)
        assert said <= names


def test_the_copy_has_the_images_and_a_protocol_that_is_read(tmp_path: Path) -> None:
    job = WorldJob(
        folder=tmp_path / "clips", clips=2, recipe=RECIPE, draw=DrawSettings(tracks=4), workers=1
    )
    write_worlds(job, Phases())
    assert write_renamed(tmp_path / "clips", tmp_path / "out") == 2
    source, copy = ClipFolder(tmp_path / "clips"), ClipFolder(tmp_path / "out")
    assert (source.clip(0).views[0].rgb == copy.clip(0).views[0].rgb).all()
    protocol = load_protocol(str(tmp_path / "out" / "protocol.json")).protocol
    assert protocol.source.kind == "shards" and protocol.source.count == 2
    content = json.loads((tmp_path / "out" / "protocol.json").read_text(encoding="utf-8"))
    assert content["text_cases"] == 2
