"""How recipes refuse a value."""

from diff4splat.errors import ConfigError


def require(holds: bool, what: str, expected: str, got: object) -> None:
    """Refuse a value that does not hold.

    Raises:
        ConfigError: with what was expected instead.
    """
    if not holds:
        raise ConfigError(f"{what}: expected {expected}, got {got}; correct the recipe")
