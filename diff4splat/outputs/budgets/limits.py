"""``--tolerance 0.5dB`` and ``--budget 10s,4GB`` as numbers.

A tolerance is a loss of PSNR against the reference setting, for a scene that the reference shows at
``REFERENCE_PSNR_DB``. Independent errors add, so a loss of L dB allows a mean square error of

    10^(−REFERENCE_PSNR_DB / 10) · (10^(L / 10) − 1)        RGB in [0, 1], against the reference
"""

import math
import re
from dataclasses import dataclass

from diff4splat.errors import ConfigError

REFERENCE_PSNR_DB = 30.0
MAX_TOLERANCE_DB = 20.0
SECONDS = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
BYTES = {"MB": 1e6, "GB": 1e9, "MiB": 2.0**20, "GiB": 2.0**30}
_QUANTITY = re.compile(r"\s*(\d+(?:\.\d+)?|\.\d+)\s*([A-Za-z]+)\s*", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a run may lose and cost; None is no limit."""

    tolerance_db: float | None = None
    seconds: float | None = None
    memory_bytes: float | None = None

    @property
    def given(self) -> bool:
        """Whether there is any limit."""
        return (self.tolerance_db, self.seconds, self.memory_bytes) != (None, None, None)

    @property
    def error(self) -> float:
        """Largest mean square error against the reference."""
        return math.inf if self.tolerance_db is None else error_from_loss(self.tolerance_db)

    def __str__(self) -> str:
        loss = [] if self.tolerance_db is None else [f"{self.tolerance_db:g} dB"]
        time = [] if self.seconds is None else [f"{self.seconds:.3g} s"]
        memory = [] if self.memory_bytes is None else [f"{self.memory_bytes / 1e9:.3g} GB"]
        return ", ".join([*loss, *time, *memory])


def parse_limits(tolerance: str | None, budget: str | None) -> Limits:
    """Both options as limits.

    Raises:
        ConfigError: a number or unit that is none, one quantity twice, or a loss that is none.
    """
    seconds, memory_bytes = (None, None) if budget is None else parse_budget(budget)
    loss_db = None if tolerance is None else parse_tolerance(tolerance)
    return Limits(tolerance_db=loss_db, seconds=seconds, memory_bytes=memory_bytes)


def parse_tolerance(text: str) -> float:
    """A loss in dB.

    Raises:
        ConfigError: no number with the unit dB, or not above 0 and at most ``MAX_TOLERANCE_DB``.
    """
    number, unit = _quantity(text, "--tolerance", ("dB",), "0.5dB")
    del unit
    if number > MAX_TOLERANCE_DB:
        raise ConfigError(
            f"--tolerance: expected a loss of at most {MAX_TOLERANCE_DB:g} dB, got {number:g} dB; "
            f"a PSNR of {number:g} dB to the reference is a loss of "
            f"{loss_from_error(10 ** (-number / 10)):.2g} dB"
        )
    return number


def parse_budget(text: str) -> tuple[float | None, float | None]:
    """(seconds, bytes) of a text such as ``10s,4GB``, ``2min`` or ``800MB``.

    Raises:
        ConfigError: no number with a known unit, or one quantity twice.
    """
    found: dict[str, float] = {}
    for part in text.split(","):
        number, unit = _quantity(part, "--budget", (*SECONDS, *BYTES), "10s,4GB")
        kind, scale = ("time", SECONDS[unit]) if unit in SECONDS else ("memory", BYTES[unit])
        if kind in found:
            raise ConfigError(
                f"--budget: expected one time and one memory, got {text!r}; name each once"
            )
        found[kind] = number * scale
    return found.get("time"), found.get("memory")


def error_from_loss(loss_db: float) -> float:
    """The mean square error that costs ``loss_db``."""
    return 10 ** (-REFERENCE_PSNR_DB / 10) * (10 ** (loss_db / 10) - 1)


def loss_from_error(error: float) -> float:
    """The loss in dB that a mean square error costs."""
    return 10 * math.log10(1 + error * 10 ** (REFERENCE_PSNR_DB / 10))


def _quantity(text: str, option: str, units: tuple[str, ...], example: str) -> tuple[float, str]:
    found = _QUANTITY.fullmatch(text)
    names = {unit.lower(): unit for unit in units}
    unit = names.get(found[2].lower()) if found else None
    if found is None or unit is None:
        raise ConfigError(
            f"{option}: expected a number and {' or '.join(units)}, such as {example}, "
            f"got {text[:40]!r}"
        )
    number = float(found[1])
    if not 0 < number < 1e9:
        raise ConfigError(f"{option}: expected more than 0 and below 1e9, got {number:g}")
    return number, unit
