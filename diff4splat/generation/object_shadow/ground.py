"""The ground that a shadow lies on, and where the shadow is on it after a displacement.

Axes: ``m`` points, ``h w`` pixels of the image.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from diff4splat.geometry.camera import Camera, project

STEP = 0.15
"""Difference of log depth up to which the ground goes on."""
ROUNDS, LEAST_DISTANCE = 8, 1e-3
"""Of the plane's fit; the distance that counts as none, over the depth."""
IN_FRONT = 0.99
"""Depth over that of the ground: a shadow is drawn before what it darkens."""


def ground_normal(points: Float[Tensor, "m 3"], weights: Float[Tensor, " m"]) -> Float[Tensor, "3"]:
    """Unit normal of the plane that most points are near, with either sign.

    A shadow may also fall on a wall: squares of distances would tilt the plane to it. Reweighted
    squares are the distances themselves (Schlossmacher 1973).
    """
    found, least = weights.double(), LEAST_DISTANCE * float(points[:, 2].mean())
    for _ in range(ROUNDS):
        shares = found / found.sum()
        from_middle = points.double() - shares @ points.double()
        covariance = from_middle.mT @ (shares[:, None] * from_middle)
        normal = torch.linalg.eigh(covariance)[1][:, 0]
        found = weights / ((from_middle @ normal).abs() + least)
    return normal.to(points)


def along_plane(vectors: Float[Tensor, "t 3"], normal: Float[Tensor, "3"]) -> Float[Tensor, "t 3"]:
    """Vectors without their part along the normal: what jumps leaves its shadow on the ground."""
    return vectors - (vectors @ normal)[:, None] * normal


def on_ground(
    points: Float[Tensor, "m 3"], camera: Camera, ground: Float[Tensor, "h w"]
) -> tuple[Float[Tensor, "m 3"], Bool[Tensor, " m"]]:
    """The points right before the surface that the input view shows there, and which have none.

    ``ground`` is the depth of static surfaces. What is nearer hides a point, which stays where it
    is; where all is farther there is nothing to darken. The camera is at the origin.
    """
    height, width = ground.shape
    pixels, z = project(camera, points)
    column, row = pixels.nan_to_num(-1).clamp(-1, max(height, width)).floor().long().unbind(-1)
    inside = (z > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    surface = ground[row.clamp(0, height - 1), column.clamp(0, width - 1)]
    ratio = torch.where(inside, surface / z, 1.0)
    meets = (ratio.log().abs() < STEP)[:, None]
    placed = torch.where(meets, points * ratio[:, None], points) * IN_FRONT
    return placed, (z <= 0) | (ratio > math.exp(STEP))
