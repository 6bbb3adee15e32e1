"""Commands must not overwrite their inputs."""

from collections.abc import Iterable
from pathlib import Path

from diff4splat.errors import ConfigError


def require_inputs_not_overwritten(inputs: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Reject an output that is also an input.

    Raises:
        ConfigError: with the name of the file.
    """
    read = {_real(file) for file in inputs}
    for file in outputs:
        if _real(file) in read:
            raise ConfigError(
                f"--out: expected another place than the input, got {file} as both; choose another"
            )


def _real(file: Path) -> str:
    try:
        return str(file.resolve())
    except OSError:
        return str(file)
