"""What a renderer must offer to be compared: a module with the names of ``Adapter``.

An adapter file imports its renderer inside functions only, so that asking what is installed loads
nothing. Three more names are optional: ``refuses(scene) -> str | None``, one line why a scene
cannot be done; ``NOTE: str``, what differs from our definition (its largest alpha, its order, what
was not timed); ``JUDGED: bool``, False for one whose image is another by design.
"""

from typing import Protocol, runtime_checkable

from jaxtyping import Float
from scenes import Scene
from torch import Tensor

from diff4splat.geometry.camera import Camera
from diff4splat.scene.gaussians import Gaussians


@runtime_checkable
class Prepared(Protocol):
    """One scene, converted to what the renderer works on. Only these two calls are timed."""

    def forward(self) -> Float[Tensor, "h w 3"]:
        """RGB over black, float32, no gradients recorded."""
        ...

    def forward_backward(self, grad_rgb: Float[Tensor, "h w 3"]) -> Gaussians | None:
        """Gradient of Σ rgb · grad_rgb in every parameter, of activated values; None: no backward.

        The fields of the result hold gradients instead of values.
        """
        ...


@runtime_checkable
class Adapter(Protocol):
    """A module that brings one renderer into the comparison."""

    NAME: str

    def unavailable(self) -> str | None:
        """One line why it cannot run here ("needs mitsuba; pip install mitsuba"), or None."""
        ...

    def prepare(self, gaussians: Gaussians, camera: Camera) -> Prepared:
        """Everything that is not timed: conversions, raw parametrisations, search structures."""
        ...


def refusal(adapter: Adapter, scene: Scene) -> str | None:
    """What the optional ``refuses`` says, or None."""
    refuses = getattr(adapter, "refuses", None)
    return None if refuses is None else refuses(scene)


def note(adapter: Adapter) -> str:
    """The optional ``NOTE``, or nothing."""
    return getattr(adapter, "NOTE", "")


def judged(adapter: Adapter) -> bool:
    """Whether its image should equal ours; the optional ``JUDGED``."""
    return getattr(adapter, "JUDGED", True)
