"""The machine and the versions that seconds depend on."""

import os
import platform
from dataclasses import dataclass

from diff4splat import __version__


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """What the seconds depend on."""

    diff4splat: str
    torch: str
    python: str
    system: str
    cores: int
    threads: int
    """Threads that PyTorch computes with."""

    def __str__(self) -> str:
        return (
            f"diff4splat {self.diff4splat}, torch {self.torch}, Python {self.python}, "
            f"{self.system}, {self.cores} cores, {self.threads} thread(s)"
        )


def this_machine() -> Machine:
    """Versions and thread counts of this process."""
    import torch

    return Machine(
        diff4splat=__version__,
        torch=torch.__version__,
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        cores=os.cpu_count() or 1,
        threads=torch.get_num_threads(),
    )
