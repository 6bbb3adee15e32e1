"""Objects of several parts."""

from dataclasses import replace

import torch
from made_worlds import made_world
from oracles_clips import make_clip

from diff4splat.data.clip import ObjectNote
from diff4splat.data.clip_objects import clip_objects
from diff4splat.data.codecs.metadata import decode_metadata, encode_metadata
from diff4splat.data.entry import entry_of


def _note(instance: int, number: int, color: str = "grey") -> ObjectNote:
    return ObjectNote(instance=instance, name="mug", color=color, motion="", object_number=number)


def test_parts_with_one_number_are_one_object() -> None:
    notes = (_note(1, 1, "red"), _note(2, 1, "white"), _note(3, 2), _note(4, 0), _note(5, 0))
    objects = clip_objects(replace(make_clip().note, objects=notes))
    assert [one.instances for one in objects] == [(1, 2), (3,), (4,), (5,)]
    assert objects[0].note.color == "red"
    image = torch.tensor([[0, 1], [2, 3]], dtype=torch.uint8)
    assert objects[0].mask(image).tolist() == [[False, True], [True, False]]


def test_a_clip_without_notes_has_no_objects() -> None:
    assert clip_objects(replace(make_clip().note, objects=())) == ()


def test_parts_of_a_drawn_object_share_name_and_motion() -> None:
    note = made_world("training", 0).note
    objects = clip_objects(note)
    assert sum(len(one.instances) for one in objects) == len(note.objects)
    assert any(len(one.instances) > 1 for one in objects)
    named = {each.instance: (each.name, each.motion) for each in note.objects}
    for one in objects:
        assert {named[number] for number in one.instances} == {(one.note.name, one.note.motion)}


def test_object_numbers_are_kept_in_files_and_absent_in_older_ones() -> None:
    clip, notes = make_clip(), (_note(1, 1), _note(2, 1))
    clip = replace(clip, note=replace(clip.note, objects=notes))
    content = encode_metadata(clip.note, entry_of(clip))
    assert decode_metadata(content, entry_of(clip)).objects == notes
    older = content.replace(b'"object_number":1', b'"other":1')
    assert [note.object_number for note in decode_metadata(older, entry_of(clip)).objects] == [0, 0]
