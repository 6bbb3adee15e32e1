"""Half a turn about x, for means, rotations and harmonics alike."""

import torch
from oracles_render import random_gaussians

from diff4splat.geometry import quaternion
from diff4splat.io.splats.axes import half_turn_about_x
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians

TURN = torch.diag(torch.tensor([1.0, -1.0, -1.0], dtype=torch.float64))


def some() -> Gaussians:
    cloud = random_gaussians(12, dtype=torch.float64)
    sh = torch.randn(12, 16, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return Gaussians(
        means=cloud.means, quats=cloud.quats, scales=cloud.scales, opacities=cloud.opacities, sh=sh
    )


def test_a_turned_viewer_sees_the_same() -> None:
    gaussians = some()
    turned = half_turn_about_x(gaussians)
    torch.testing.assert_close(turned.means, gaussians.means @ TURN)
    axes = quaternion.to_matrix(gaussians.quats) * gaussians.scales[:, None]
    own = quaternion.to_matrix(turned.quats) * turned.scales[:, None]
    torch.testing.assert_close(own @ own.mT, TURN @ axes @ axes.mT @ TURN)
    directions = torch.nn.functional.normalize(gaussians.means, dim=-1)
    torch.testing.assert_close(
        harmonics.color(turned.sh, directions @ TURN), harmonics.color(gaussians.sh, directions)
    )


def test_twice_is_not_at_all() -> None:
    gaussians = some()
    again = half_turn_about_x(half_turn_about_x(gaussians))
    for name in Gaussians.__slots__:
        torch.testing.assert_close(getattr(again, name), getattr(gaussians, name))
