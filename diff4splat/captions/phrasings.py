"""Free sentences that ask one object to move to one side.

``VALIDATION`` is a tenth of the templates; no network is trained on it.
"""

from dataclasses import dataclass
from typing import TypeVar

from diff4splat.captions.grammar import NamedObject
from diff4splat.captions.synonyms import (
    ANY_OBJECT,
    COLOR_SYNONYMS,
    NOUN_SYNONYMS,
    SIDES,
    TRAVEL_VERBS,
)

TRAINING = (
    *("the {name} {moves} {side}", "a {name} {moves} {side}", "the {name} is {moving} {side}"),
    *("move the {name} {side}", "make the {name} {move} {side}", "let the {name} {move} {side}"),
    *("the {name} slowly {moves} {side}", "the {name} {moves} {side} slowly"),
    *("the {name} quickly {moves} {side}", "gently the {name} {moves} {side}"),
    *("{name} {moving} {side}", "{name} {moves} {side}", "a {name} that {moves} {side}"),
    *("only the {name} {moves} {side}", "the {name} {moves} {side}, nothing else moves"),
    *("the {name} {moves} {side} while all else stays in place", "a {name} {moving} {side}"),
    *("the {name} starts to {move} {side}", "the {name} begins {moving} {side}"),
    *("the {name} should {move} {side}", "I want the {name} to {move} {side}"),
    *("please move the {name} {side}", "we see the {name} {moving} {side}"),
    *("the {name} keeps {moving} {side}", "a video of the {name} {moving} {side}"),
    *("in this video the {name} {moves} {side}", "the {name} in the picture {moves} {side}"),
    *("the {name} {moves} a bit {side}", "the {name} {moves} far {side}", "push the {name} {side}"),
    *(
        "the {name} has to {move} {side}",
        "here the {name} {moves} {side}",
        "shift the {name} {side}",
    ),
    *("now the {name} {moves} {side}", "suddenly the {name} {moves} {side}"),
    *("there is a {name} {moving} {side}", "watch the {name} {move} {side}"),
    *("the {name} will {move} {side}", "the {name} can be seen {moving} {side}"),
    *("someone moves the {name} {side}", "the {name} is pushed {side}", "pull the {name} {side}"),
    *("the {name} is pulled {side}", "the {name} gets moved {side}"),
    *("animate the {name} so that it {moves} {side}", "the {name}, {moving} {side}"),
    *("it is the {name} that {moves} {side}", "motion of the {name} {side}"),
)
VALIDATION = (
    *("see how the {name} {moves} {side}", "the {name} ought to be {moving} {side}"),
    *("a short film in which the {name} {moves} {side}", "what {moves} {side} is the {name}"),
    "have the {name} {move} {side}",
)
Word = TypeVar("Word")


@dataclass(slots=True)
class Choices:
    """Independent choices out of one number from 0 to 2³¹."""

    number: int

    def pick(self, words: tuple[Word, ...]) -> Word:
        """One of ``words``."""
        self.number, index = divmod(self.number, len(words))
        return words[index]


def request(
    name: str, direction: str, choices: Choices, templates: tuple[str, ...] = TRAINING
) -> str:
    """A sentence in which the object called ``name`` moves to one side."""
    template = choices.pick(templates)
    moves, move, moving = choices.pick(TRAVEL_VERBS)
    side = choices.pick(SIDES[direction])
    sentence = template.format(name=name, moves=moves, move=move, moving=moving, side=side)
    return sentence.replace(f"a {name}", f"an {name}") if name[0] in "aeiou" else sentence


def object_name(named: NamedObject, choices: Choices) -> str:
    """Colour and noun, or synonyms of them."""
    color = choices.pick(_with_synonyms(named.color, COLOR_SYNONYMS))
    return f"{color} {noun_name(named.noun, choices)}"


def noun_name(noun: str, choices: Choices) -> str:
    """The noun half of the time, else a synonym."""
    return choices.pick(_with_synonyms(noun, NOUN_SYNONYMS))


def any_object_name(color: str, choices: Choices) -> str:
    """The colour and a word for any object."""
    return f"{color} {choices.pick(ANY_OBJECT)}"


def _with_synonyms(word: str, synonyms: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    others = synonyms.get(word, ())
    return (word,) * max(len(others), 1) + others
