"""Motion by the deformation network: of the cells that are left; none where it is zero."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.generation.video.canonical_scene import CanonicalScene, reconstruct
from diff4splat.generation.video.deformation_motion import deform
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.deformation.keyframes import DeformationUnits
from diff4splat.models.deformation.network import DeformationNetwork
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH, plane_base
from diff4splat.models.ldrm.raw_maps import RawGaussianMaps
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.static import StaticMotion

CONFIG = size_by_name("test")
UNITS = DeformationUnits(length_unit=PLANE_DEPTH, activation=CONFIG.activation)
KEY_TIMES_S = torch.tensor([0.0, 1.0, 2.0])


def canonical() -> CanonicalScene:
    """Five frames of random corrections of an image."""
    image = input_image(random_rgb(32, 32))
    cameras = image.camera.with_pose(torch.eye(4).expand(5, 4, 4))
    maps = RawGaussianMaps(
        gaussians=torch.randn(1, 12, 5, 32, 32), tokens=torch.randn(1, 24, 2, 2, 2)
    )
    return reconstruct(maps, plane_base(image.rgb, image.camera, cameras, 1), CONFIG.activation)


def moving_network() -> DeformationNetwork:
    torch.manual_seed(1)
    network = DeformationNetwork(CONFIG)
    for parameter in network.heads.parameters():
        parameter.data = torch.randn(parameter.shape)
    return network


@torch.no_grad()
def test_the_motion_of_some_cells_is_part_of_the_motion_of_all() -> None:
    whole, network = canonical(), moving_network()
    third = torch.arange(len(whole.cell_index)) % 3 == 1
    pruned = replace(
        whole, gaussians=whole.gaussians.select(third), cell_index=whole.cell_index[third]
    )
    of_all = deform(network, whole, KEY_TIMES_S, UNITS, RunLog())
    of_some = deform(network, pruned, KEY_TIMES_S, UNITS, RunLog())
    assert isinstance(of_all, KeyframeMotion)
    assert torch.equal(of_some.moving_index, torch.arange(int(third.sum())))
    for name in ("offsets", "rotations", "log_scale_offsets"):
        wanted = getattr(of_all, name)[:, pruned.cell_index]
        torch.testing.assert_close(getattr(of_some, name), wanted)


@torch.no_grad()
def test_no_cells_have_no_tracks() -> None:
    whole = canonical()
    nothing = whole.cell_index[:0]
    empty = replace(whole, gaussians=whole.gaussians.select(nothing), cell_index=nothing)
    motion = deform(moving_network(), empty, KEY_TIMES_S, UNITS, RunLog())
    assert len(motion.moving_index) == 0


def test_a_network_that_is_the_identity_is_not_run() -> None:
    network, log = DeformationNetwork(CONFIG), RunLog()
    network.register_forward_pre_hook(lambda *_: pytest.fail("it ran"))
    motion = deform(network, canonical(), KEY_TIMES_S, UNITS, log)
    assert isinstance(motion, StaticMotion) and motion.time_range_s == (0.0, 2.0)
    assert [omission.what for omission in log.skipped] == ["deformation network"]


def test_without_a_network_nothing_moves() -> None:
    log = RunLog()
    motion = deform(None, canonical(), KEY_TIMES_S, UNITS, log)
    assert isinstance(motion, StaticMotion) and motion.time_range_s == (0.0, 2.0)
    assert len(log.skipped) == 0
