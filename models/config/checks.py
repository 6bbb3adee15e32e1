"""Checks that configurations share; all raise a ConfigError in one form."""

from typing import Protocol, runtime_checkable

from diff4splat.errors import ConfigError

MAX_COUNT, MAX_BLOCKS = 1 << 20, 1000
"""More is damage; networks would be built for hours before the memory is counted."""
MAX_QUOTED = 200
"""Characters of a refused value."""


@runtime_checkable
class HasHeads(Protocol):
    """A transformer's width and number of attention heads."""

    width: int
    heads: int


def require(holds: bool, what: str, expected: str, got: object) -> None:
    """Raise a ConfigError unless ``holds``."""
    if not holds:
        raise ConfigError(f"{what}: expected {expected}, got {repr(got)[:MAX_QUOTED]}")


def require_counts(config: object, *names: str) -> None:
    """Every named field must be a whole number from 1 to a limit of its kind."""
    for name in names:
        value, most = getattr(config, name), MAX_BLOCKS if name == "blocks" else MAX_COUNT
        whole = isinstance(value, int) and not isinstance(value, bool)
        require(
            whole and 1 <= value <= most,
            f"{type(config).__name__}.{name}",
            f"a whole number of at least 1 and at most {most}",
            value,
        )


def require_heads(config: HasHeads, smallest: int) -> None:
    """The width must split into heads of an even width of at least ``smallest``."""
    what = f"{type(config).__name__}.heads"
    require(
        config.width % config.heads == 0, what, f"a divisor of width {config.width}", config.heads
    )
    head = config.width // config.heads
    require(head % 2 == 0 and head >= smallest, what, f"even heads of at least {smallest}", head)


def require_optional_width(config: object, name: str) -> None:
    """The named field must be a whole number; 0 leaves the network out."""
    value = getattr(config, name)
    whole = isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_COUNT
    require(whole, f"{type(config).__name__}.{name}", "a whole number of at least 0", value)
