"""Encoded text of one generation: the prompt, its events, and what guidance leads away from.

Axes: ``s d`` tokens and channels of one text.
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from diff4splat.captions.events import is_in_place, local_motion, moving_events
from diff4splat.captions.image_classes.prompt_classes import prompt_classes
from diff4splat.generation.inputs.request import Request, negative_prompt
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.models.hub.model import Model
from diff4splat.progress.run_log import RunLog


@dataclass(frozen=True, slots=True, kw_only=True)
class EventStates:
    """One event of the prompt; without a prompt there is one without words."""

    words: str = ""
    states: Float[Tensor, "1 s d"] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TextStates:
    """Encoded text of one generation."""

    prompt: Float[Tensor, "1 s d"] | None = None
    negative: Float[Tensor, "1 s2 d"] | None = None
    """What guidance leads away from; all there is for a model that needs text, without a prompt."""
    events: tuple[EventStates, ...] = (EventStates(),)


def encode_text(request: Request, model: Model, log: RunLog) -> TextStates:
    """All text that the networks of ``request`` see."""
    if "text_encoder" not in request.plan.parts:
        return TextStates()
    encode = model.networks.text_encoder.encode_prompt
    negative = negative_prompt(request, model.config)
    with log.phases.phase("encode text"):
        states = None if negative is None else encode(negative)
        if request.prompt is None:
            return TextStates(negative=states)
        prompt = encode(request.prompt)
        events = tuple(
            EventStates(words=words, states=prompt if words == request.prompt else encode(words))
            for words in moving_events(request.prompt)
        )
        return TextStates(prompt=prompt, negative=states, events=events)


def motion_requests(request: Request, text: TextStates) -> list[MotionRequest]:
    """One for each event of the prompt."""
    key_times_s = tuple(request.key_times_s.tolist())
    return [
        MotionRequest(
            text=event.states,
            seed=request.seed,
            settings=request.settings,
            classes=prompt_classes(event.words),
            local_motion=local_motion(event.words),
            in_place=is_in_place(event.words),
            key_times_s=key_times_s,
        )
        for event in text.events
    ]
