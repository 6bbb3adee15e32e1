"""Every exception that diff4splat raises on purpose.

Message form: ``what: expected X, got Y; do Z``. The command line prints the message alone, on one
line, and exits with code 2; everything else is a bug and keeps its traceback.
"""


class Diff4SplatError(Exception):
    """Root of the errors a person can act on."""


class ShapeError(Diff4SplatError, ValueError):
    """A tensor has the wrong shape, dtype or device."""


class ConfigError(Diff4SplatError, ValueError):
    """A setting is unknown, out of range, or contradicts another."""


class InputError(Diff4SplatError, ValueError):
    """Something the user handed in (image, prompt, camera path) cannot be used."""


class FileFormatError(Diff4SplatError, ValueError):
    """A file is damaged, from a newer version, or not of the expected kind."""


class OutputError(Diff4SplatError, OSError):
    """An output cannot be written: no permission, no space, or a file in the way."""


class CheckpointError(Diff4SplatError, ValueError):
    """Weights do not belong to the configuration that should load them."""


class DivergenceError(Diff4SplatError, RuntimeError):
    """A training run does not learn any more: too many skips, or spikes that come back."""


class MissingExtraError(Diff4SplatError, ImportError):
    """An optional dependency is not installed."""
