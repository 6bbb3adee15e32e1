"""The error of one Gaussian in pixels, computed by hand."""

from dataclasses import replace

import torch
from oracles_hexplane import F64

from diff4splat.geometry.camera import pinhole
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.bake_error import pixel_errors

CAMERA = pinhole(100.0, (90, 120), F64)


def test_the_error_of_one_gaussian_by_hand() -> None:
    """At depth 2 a step of 0.01 shows as 0.5 px of 100; an end 0.1 longer as 5 px more."""
    one = Gaussians(
        means=torch.tensor([[0.0, 0, 2]], dtype=F64),
        quats=torch.tensor([[1.0, 0, 0, 0]], dtype=F64),
        scales=torch.tensor([[0.1, 0.1, 0.3]], dtype=F64),
        opacities=torch.ones(1, dtype=F64),
        sh=torch.zeros(1, 1, 3, dtype=F64),
    )
    cameras = CAMERA.with_pose(torch.eye(4, dtype=F64)[None].repeat(2, 1, 1))
    cameras = replace(
        cameras, focal_px=cameras.focal_px.expand(2, 2), center_px=cameras.center_px.expand(2, 2)
    )
    moved = replace(one, means=one.means + torch.tensor([0.01, 0, 0]))
    torch.testing.assert_close(pixel_errors(one, moved, cameras).tolist(), [0.5, 0.5])
    wider = replace(moved, scales=one.scales + torch.tensor([0.1, 0, 0]))
    torch.testing.assert_close(pixel_errors(one, wider, cameras).tolist(), [5.5, 5.5])
    # Along the view a longer axis shows only where the Gaussian lies beside the middle.
    longer = replace(one, scales=one.scales + torch.tensor([0, 0, 0.1]))
    assert pixel_errors(one, longer, cameras).tolist() == [0, 0]
    unseen = replace(one, opacities=one.opacities * 0.003)
    behind = replace(one, means=-one.means)
    assert (
        len(pixel_errors(unseen, moved, cameras)) == len(pixel_errors(behind, moved, cameras)) == 0
    )
