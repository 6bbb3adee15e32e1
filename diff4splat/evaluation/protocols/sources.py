"""Clip sources of an evaluation."""

from typing import Protocol as Interface
from typing import runtime_checkable

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.evaluation.protocols.protocol import Protocol


@runtime_checkable
class ClipSource(Interface):
    """Clips by index; the same index always gives the same clip."""

    def __len__(self) -> int:
        """Number of clips."""
        ...

    def clip(self, index: int) -> Clip:
        """Generate or read one clip."""
        ...


def require_enough(source: ClipSource, protocol: Protocol) -> ClipSource:
    """Return ``source`` if it has all clips of ``protocol``.

    Raises:
        InputError: the source is empty or too short.
    """
    needed = protocol.source.first + protocol.source.count
    if len(source) < needed:
        raise InputError(
            f"clips: expected at least {needed} for protocol {protocol.name}, got {len(source)}; "
            "make more, or lower source.count in a protocol file of your own"
        )
    return source
