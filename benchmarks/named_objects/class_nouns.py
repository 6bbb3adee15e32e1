"""Write the nouns of ImageNet's classes: ``python -m benchmarks.named_objects.class_nouns ...``.

Arguments: a file with the WordNet id of every class, in order (``imagenet_synsets.txt`` of the
Python package timm), the folder of WordNet 3.0 (Debian package wordnet-base), and the file to
write, ``diff4splat/captions/image_classes/nouns.txt``.

A noun means the classes that are it, or a kind of it, in one of its first senses. Words that are
rarely nouns stay out, as do words of motions, and nouns of more than ``MOST_CLASSES``.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from diff4splat.captions.known_words import read_prompt
from diff4splat.io.atomic import write_text

SENSES, MOST_CLASSES = 3, 130
NOUN_SHARE = 0.6
"""Of a word's uses in WordNet's texts, in the least."""
NO_OBJECTS = ("individual", "mortal", "somebody", "someone", "soul")
"""Words of sentences around what moves: ``someone pushes the ball``."""
ALSO = {
    "burger": "cheeseburger",
    "chicken": "cock|hen",
    "cow": "ox",
    "crow": "jay|magpie",
    "cup": "coffee mug|cup|espresso",
    "deer": "impala|hartebeest|gazelle",
    "donkey": "sorrel",
    "glasses": "sunglasses",
    "kettle": "teapot|coffeepot",
    "mug": "coffee mug",
    "mushroom": "mushroom|agaric|bolete",
    "plane": "airliner|warplane",
    "plate": "plate|tray",
    "rocket": "missile|projectile|space shuttle",
    "rooster": "cock",
    "spaceship": "space shuttle",
    "spoon": "wooden spoon|ladle",
    "tree": "buckeye",
    "van": "minivan|moving van|police van",
    "woman": "groom",
}
"""Classes by name for nouns whose own senses lie elsewhere in WordNet."""


class WordNet:
    """Nouns, their senses and what these are kinds of."""

    def __init__(self, folder: Path) -> None:
        self.words: dict[int, list[str]] = {}
        self.kinds_of: dict[int, set[int]] = defaultdict(set)
        self.senses: dict[str, list[int]] = {}
        for line in _lines(folder / "data.noun"):
            self._add_synset(line.split(" | ")[0].split())
        for line in _lines(folder / "index.noun"):
            parts = line.split()
            senses = parts[4 + int(parts[3]) + 2 :]
            self.senses[_word(parts[0])] = [int(offset) for offset in senses[:SENSES]]
        self.uses = _uses(folder / "cntlist.rev")

    def is_noun(self, word: str) -> bool:
        """Whether it is used as one most of the time, or never in the texts."""
        uses = self.uses.get(word, {})
        return uses.get("noun", 0) >= NOUN_SHARE * sum(uses.values())

    def ancestors(self, synset: int) -> set[int]:
        """The synset and all that it is a kind of."""
        found, fresh = set(), {synset}
        while fresh:
            found |= fresh
            fresh = set().union(*(self.kinds_of[one] for one in fresh)) - found
        return found

    def _add_synset(self, parts: list[str]) -> None:
        synset, words = int(parts[0]), int(parts[3], 16)
        self.words[synset] = [_word(word) for word in parts[4 : 4 + 2 * words : 2]]
        pointers = parts[5 + 2 * words :]
        for kind, other, part in zip(pointers[::4], pointers[1::4], pointers[2::4], strict=False):
            if kind in ("@", "@i") and part == "n":
                self.kinds_of[synset].add(int(other))


def nouns_of_classes(net: WordNet, classes: list[int]) -> dict[str, set[int]]:
    """The classes of every noun."""
    below: dict[int, set[int]] = defaultdict(set)
    for number, synset in enumerate(classes):
        for ancestor in net.ancestors(synset):
            below[ancestor].add(number)
    nouns: dict[str, set[int]] = defaultdict(set)
    for word, senses in net.senses.items():
        if not net.is_noun(word) or _is_other_word(word):
            continue
        for synset in senses:
            if 0 < len(below.get(synset, ())) <= MOST_CLASSES:
                nouns[word] |= below[synset]
    for noun, names in ALSO.items():
        wanted = names.split("|")
        nouns[noun] |= {k for k, one in enumerate(classes) if set(net.words[one]) & {*wanted}}
    return {word: found for word, found in nouns.items() if 0 < len(found) <= MOST_CLASSES}


def ranges(numbers: Iterable[int]) -> str:
    """``3 5-8``."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return " ".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


def _is_other_word(word: str) -> bool:
    """Whether captions use it for a motion, a place or no object at all."""
    read = read_prompt(word)
    known = word in NO_OBJECTS or not (read.unknown or read.objects)
    return bool(read.motions) or known or not word.replace(" ", "").isalpha() or len(word) < 3


def _uses(file: Path) -> dict[str, dict[str, int]]:
    """How often texts use a word as a noun, and as something else."""
    kinds = {"1": "noun", "2": "verb", "3": "adjective", "4": "adverb", "5": "adjective"}
    uses: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for line in file.read_text(encoding="utf-8").splitlines():
        key, _, count = line.split()
        word, sense = key.split("%")
        uses[_word(word)][kinds[sense[0]]] += int(count)
    return uses


def _lines(file: Path) -> Iterator[str]:
    """Without the licence at the start."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return (line for line in lines if not line.startswith(" "))


def _word(lemma: str) -> str:
    return lemma.lower().replace("_", " ")


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("synsets", type=Path)
    parser.add_argument("wordnet", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    classes = [int(line[1:]) for line in options.synsets.read_text().split()]
    nouns = nouns_of_classes(WordNet(options.wordnet), classes)
    lines = [f"{noun}: {ranges(found)}\n" for noun, found in sorted(nouns.items())]
    write_text(options.out, "".join(lines))


if __name__ == "__main__":
    main()
