"""``--tolerance``, ``--budget`` and ``--calibration``, read before any large library is loaded."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from diff4splat.cli.options.constraints import InputPath

if TYPE_CHECKING:
    from diff4splat.outputs.budgets.limits import Limits


@dataclass(frozen=True, kw_only=True)
class LimitOptions:
    """What a run may lose and cost; the cheapest measured setting that holds is taken."""

    tolerance: str | None = None
    """Largest loss of PSNR against the reference setting, such as 0.5dB. Options that are given
    stay as they are."""
    budget: str | None = None
    """Largest time and memory, such as 10s,4GB, 2min or 800MB; the most exact setting that fits is
    taken."""
    calibration: Annotated[Path | None, InputPath(what="a calibration table", folder=False)] = None
    """Table of measured costs and errors. Default: the one that `diff4splat report calibrate` wrote
    on this machine, else the one that ships."""

    @property
    def limits(self) -> "Limits":
        """Both as numbers."""
        from diff4splat.outputs.budgets.limits import parse_limits

        return parse_limits(self.tolerance, self.budget)

    def check(self) -> None:
        """Refuse units that do not exist, and tables that cannot be used."""
        from diff4splat.outputs.budgets.table import find_table

        if self.limits.given or self.calibration is not None:
            find_table(self.calibration)
