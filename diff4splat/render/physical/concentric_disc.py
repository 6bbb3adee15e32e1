"""Concentric map of the unit square to the unit disc: points on a lens.

It preserves areas and neighbourhoods.

Concentric squares become concentric circles (Shirley and Chiu, A Low Distortion Map Between Disk
and Square, JGT 1997): with (a, b) = 2 u - 1 and |a| > |b| the point has radius a and angle
π/4 · b / a; else radius b and angle π/2 - π/4 · a / b.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor


def disc_points(square: Float[Tensor, "*b 2"]) -> Float[Tensor, "*b 2"]:
    """Points of [0, 1]² on the disc of radius 1; the square's centre is the disc's."""
    a, b = (2 * square - 1).unbind(-1)
    wide = a.abs() > b.abs()
    radius = torch.where(wide, a, b)
    share = torch.where(wide, b, a) / torch.where(radius == 0, 1.0, radius)
    angle = math.pi / 4 * share
    angle = torch.where(wide, angle, math.pi / 2 - angle)
    return radius[..., None] * torch.stack([angle.cos(), angle.sin()], -1)
