"""Validation worlds with objects and nouns that no training shows, as test worlds have them.

Usage: python -m benchmarks.unseen_objects CLIPS OUT

CLIPS are worlds with random shapes (``prepare synth --composite-share``). OUT gets the same clips,
in which those are called by one of the twelve nouns that training leaves out, and a protocol:
``diff4splat eval --model small --protocol OUT/protocol.json --task text --out RESULT``.
To weights that were trained with random shapes only the nouns are new.
"""

import argparse
import json
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from diff4splat.captions.grammar import CaptionFacts, NamedObject, describe, parse_caption
from diff4splat.captions.vocabulary import UNNAMED, UNSEEN_NOUNS
from diff4splat.data.clip import Clip, ClipMetadata
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data.shard_writer import ShardOptions, ShardWriter

TEMPLATE = Path(__file__).with_name("kept_back_text.json")


def renamed(note: ClipMetadata) -> ClipMetadata:
    """Random shapes of one clip share a noun, which follows from its identifier."""
    noun = UNSEEN_NOUNS[zlib.crc32(note.identifier.encode()) % len(UNSEEN_NOUNS)]

    def named(one: NamedObject) -> NamedObject:
        return replace(one, noun=noun) if one.noun == UNNAMED else one

    objects = tuple(
        replace(one, name=noun if one.name == UNNAMED else one.name) for one in note.objects
    )
    caption = describe(_with_names(parse_caption(note.caption), named), 0)
    return replace(note, caption=caption, objects=objects)


def _with_names(facts: CaptionFacts, named: Callable[[NamedObject], NamedObject]) -> CaptionFacts:
    events = tuple(
        replace(
            event,
            subject=named(event.subject),
            beside=None if event.beside is None else named(event.beside),
        )
        for event in facts.events
    )
    return replace(facts, events=events, static_objects=tuple(map(named, facts.static_objects)))


def write_renamed(clips: Path, out: Path) -> int:
    """Copy the clips with other nouns, and write the protocol; returns how many there are."""
    folder = ClipFolder(clips)
    with ShardWriter(out, ShardOptions(generator="unseen objects")) as writer:
        for index in range(len(folder)):
            clip: Clip = folder.clip(index)
            writer.write(replace(clip, note=renamed(clip.note)))
    protocol = json.loads(TEMPLATE.read_text(encoding="utf-8"))
    source = protocol["source"] | {"kind": "shards", "folder": ".", "count": len(folder)}
    protocol |= {"name": "unseen_objects", "source": source, "text_cases": len(folder)}
    (out / "protocol.json").write_text(json.dumps(protocol, indent=2) + "\n", encoding="utf-8")
    return len(folder)


def main() -> None:
    """Write both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    count = write_renamed(options.clips, options.out)
    print(f"wrote {count} clips and protocol.json to {options.out}")


if __name__ == "__main__":
    main()
