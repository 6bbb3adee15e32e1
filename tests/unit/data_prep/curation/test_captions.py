"""Captions from files of every form and from a model; damaged files say where."""

import json
from dataclasses import replace

import pytest
from textured_clips import textured_clip

from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.shard_writer import ShardOptions, ShardWriter
from diff4splat.data_prep.curation.captions.captioning import CaptionJob, write_captions
from diff4splat.data_prep.curation.captions.side_car import SideCarCaptions
from diff4splat.errors import ConfigError, FileFormatError
from diff4splat.progress.phases import Phases

TEXT = "Ein Hund läuft\tüber den\nSteg"
CLEAN = "Ein Hund läuft über den Steg"


def note(identifier: str, scene: str = "pier"):
    return replace(textured_clip(1).note, identifier=identifier, scene=scene, dataset="real")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("c.json", json.dumps({"a": TEXT, "real/pier": "pier"})),
        (
            "c.jsonl",
            json.dumps({"id": "a", "caption": TEXT}) + '\n\n{"scene":"pier","text":"pier"}',
        ),
        ("c.csv", f'\ufeffvideo,caption\na,"{TEXT}"\npier,pier\n'),
        ("c.tsv", "file_name\tPrompt\na\tEin Hund  läuft über den Steg\npier\tpier\n"),
    ],
)
def test_every_form_gives_captions_by_clip_and_by_scene(tmp_path, name, content) -> None:
    file = tmp_path / name
    file.write_text(content, encoding="utf-8")
    captions = SideCarCaptions(file)
    assert captions.caption(note("a")) == CLEAN
    assert captions.caption(note("b")) == "pier"
    assert captions.caption(note("b", scene="other")) == ""


def test_a_folder_of_texts_and_scenes_that_lead_outside(tmp_path) -> None:
    folder = tmp_path / "texts"
    folder.mkdir()
    (folder / "a.txt").write_text(TEXT, encoding="utf-8")
    (tmp_path / "secret.txt").write_text("secret")
    captions = SideCarCaptions(folder)
    assert captions.caption(note("a")) == CLEAN
    assert captions.caption(note("b", scene="../secret")) == ""


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("c.txt", b"a", "a folder of .txt"),
        ("c.json", b"[1]", "one object"),
        ("c.json", b'{"a": 3}', "as text, got 3"),
        ("c.jsonl", b'{"id": "a", "caption": "x"}\n{"id"', "line 2: expected an object"),
        ("c.jsonl", b'{"id": "a"}', "line 1: expected one of"),
        ("c.csv", b"a,b\n1,2\n", "line 2: expected one of"),
        ("c.csv", b"id,text\na,\xff\n", "UTF-8"),
        ("c.csv", b"id,text\na,x\na,y\n", "one caption per key"),
        ("c.csv", b"id,text\na," + b"x" * 5000 + b"\n", "up to 4000 characters"),
    ],
)
def test_damaged_captions_say_where(tmp_path, name, content, message) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        SideCarCaptions(file)


def test_captions_reach_clips_and_all_other_bytes_stay(tmp_path, monkeypatch) -> None:
    clips = [textured_clip(2, identifier=name) for name in ("a", "b", "c")]
    clips[2] = replace(clips[2], note=replace(clips[2].note, caption="there already"))
    with ShardWriter(tmp_path / "in", ShardOptions(generator="test")) as writer:
        for clip in clips:
            writer.write(clip)
    (tmp_path / "c.json").write_text(json.dumps({"a": "from the file", "c": "another"}))
    (tmp_path / "my_captioner.py").write_text(
        "def caption(clip):\n    assert clip.views[0].rgb.shape[0] == 2\n"
        "    return f'from the model: {clip.note.dataset}'\n"
    )
    monkeypatch.chdir(tmp_path)
    job = CaptionJob(
        clips=tmp_path / "in",
        folder=tmp_path / "out",
        side_car=tmp_path / "c.json",
        captioner="my_captioner:caption",
    )
    rows = write_captions(job, Phases())
    assert {row.status for row in rows} == {"written"}
    found = ClipFolder(tmp_path / "out")
    captions = [found.clip(position).note.caption for position in range(3)]
    assert captions == ["from the file", "from the model: planes", "there already"]
    source = ClipFolder(tmp_path / "in")
    for position in range(3):
        old, new = source.encoded(position), found.encoded(position)
        changed = [
            a.suffix
            for a, b in zip(old.members, new.members, strict=True)
            if a.content != b.content
        ]
        assert changed == ([] if position == 2 else ["meta.json"])
    assert {row.status for row in write_captions(job, Phases())} == {"present"}


def test_a_captioner_that_fails_is_a_row(tmp_path, monkeypatch) -> None:
    with ShardWriter(tmp_path / "in", ShardOptions(generator="test")) as writer:
        writer.write(textured_clip(2, identifier="a"))
    (tmp_path / "failing_captioner.py").write_text("def caption(clip):\n    return 1 / 0\n")
    monkeypatch.chdir(tmp_path)
    job = CaptionJob(
        clips=tmp_path / "in", folder=tmp_path / "out", captioner="failing_captioner:caption"
    )
    (row,) = write_captions(job, Phases())
    assert (row.status, row.error) == ("failed", "ZeroDivisionError")
    with pytest.raises(ConfigError, match="got neither"):
        CaptionJob(clips=tmp_path, folder=tmp_path)
