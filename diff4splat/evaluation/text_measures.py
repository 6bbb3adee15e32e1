"""Does the text decide what moves, and where to?

Per case one picture and one seed, and three captions: the named object moves to the left, to the
right, and nothing moves. Its scene flow from the first to the last time, averaged over the pixels
that show it in the first picture, must point to the asked side of the input camera. A system that
ignores text moves it to the same side both times: half right, never both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, runtime_checkable
from typing import Protocol as Interface

from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip, ObjectNote
from diff4splat.evaluation.picture_measures import Entries
from diff4splat.evaluation.predictions import scene_flow
from diff4splat.evaluation.protocol import Protocol
from diff4splat.evaluation.records import Score, Skip
from diff4splat.evaluation.sample import Case
from diff4splat.evaluation.scene_measures import moving_share
from diff4splat.scene.scene import Scene

Wish = Literal["left", "right", "still"]
Captioner = Callable[[Clip, ObjectNote, Wish], str]
"""The clip's caption with another motion of one object."""
KEYS = ("text_right", "text_both", "text_still")
LEAST_SHARE = 0.002
"""Of the picture that an object must fill to be judged."""


@runtime_checkable
class TextSubject(Interface):
    """A system that reads captions."""

    def generate(self, case: Case, prompt: str | None, seed: int) -> Scene:
        """A scene for the case's first picture and another caption."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TextCase:
    """One object to be moved."""

    case: Case
    note: ObjectNote
    shown: Bool[Tensor, "h w"]
    """Where the first picture shows it."""


def plain_caption(clip: Clip, note: ObjectNote, wish: Wish) -> str:
    """A short sentence; it depends on the object only."""
    del clip
    thing = " ".join(word for word in ("the", note.color, note.name) if word)
    return "nothing moves" if wish == "still" else f"{thing} moves to the {wish}"


def text_case(case: Case) -> TextCase | None:
    """The largest named object of the first picture, moving ones first; None if it shows none."""
    instances = case.input_view.instances
    if instances is None:
        return None
    shown = [(note, instances[0] == note.instance) for note in case.clip.note.objects]
    large = [(n, mask) for n, mask in shown if float(mask.double().mean()) >= LEAST_SHARE]
    if not large:
        return None
    note, mask = max(large, key=lambda pair: (pair[0].motion != "", int(pair[1].sum())))
    return TextCase(case=case, note=note, shown=mask)


def text_entries(
    row: str, case: Case, subject: TextSubject, captioner: Captioner, protocol: Protocol
) -> Entries:
    """Direction and stillness of one case."""
    found = text_case(case)
    if found is None:
        return [
            Skip(row=row, key=key, why="the first picture shows no named object") for key in KEYS
        ]
    scenes = {
        wish: subject.generate(case, captioner(case.clip, found.note, wish), protocol.seed)
        for wish in ("left", "right", "still")
    }
    left, right = rightward(scenes["left"], found) < 0, rightward(scenes["right"], found) > 0
    camera, times_s = case.input_view.cameras[0], case.clip.times_s
    still = 1 - moving_share(scenes["still"], camera, times_s, protocol.still_px)
    values = ((left + right) / 2, float(left and right), round(still, 6))
    return [Score(row=row, key=key, value=v) for key, v in zip(KEYS, values, strict=True)]


def rightward(scene: Scene, found: TextCase) -> float:
    """Mean scene flow of the object along x of the first input camera, which is the world's."""
    camera, last_s = found.case.input_view.cameras[0], float(found.case.clip.times_s[-1])
    flow = scene_flow(scene, camera, 0.0, (last_s,))[0]
    return float(flow[..., 0][found.shown].mean())


def motionless_entries(row: str, case: Case) -> Entries:
    """What a scene without motion gets: no direction is ever right, everything stands still."""
    if text_case(case) is None:
        return []
    return [Score(row=row, key=key, value=v) for key, v in zip(KEYS, (0.0, 0.0, 1.0), strict=True)]
