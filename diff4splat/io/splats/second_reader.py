"""gsply, another program's reader of PLY and SPZ (the extra ``formats``), imported here alone."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import torch

from diff4splat.io.splats.axes import half_turn_about_x
from diff4splat.scene.gaussians import Gaussians

NAME = "gsply"
SUFFIXES = (".ply", ".spz")


def second_reader(file: Path) -> Callable[[Path], Gaussians] | None:
    """What else can read this kind of file; None where gsply is not installed."""
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES or find_spec(NAME) is None:
        return None
    return _read_ply if suffix == ".ply" else _read_spz


def _read_ply(file: Path) -> Gaussians:
    import gsply

    return _gaussians(gsply.plyread(str(file)))


def _read_spz(file: Path) -> Gaussians:
    import gsply

    return half_turn_about_x(_gaussians(gsply.read_spz(file)))


def _gaussians(stored: object) -> Gaussians:
    """Activated values of gsply's, which are those of a PLY."""
    dc = _tensor(stored.sh0)[:, None]
    rest = np.zeros(0) if stored.shN is None else stored.shN
    return Gaussians(
        means=_tensor(stored.means),
        quats=torch.nn.functional.normalize(_tensor(stored.quats), dim=-1),
        scales=_tensor(stored.scales).exp(),
        opacities=_tensor(stored.opacities).flatten().sigmoid(),
        sh=torch.cat([dc, _tensor(rest).reshape(len(dc), -1, 3)], 1) if rest.size else dc,
    )


def _tensor(values: object) -> torch.Tensor:
    return torch.from_numpy(np.array(values, np.float32, copy=True))
