"""Pruning keeps track of cells, and deformation reads the cells it was given."""

from dataclasses import replace

import torch

from diff4splat.generation.input_image import InputImage
from diff4splat.generation.reconstruction import (
    Canonical,
    deform,
    motion_from_offsets,
    prune_cells,
    reconstruct,
)
from diff4splat.geometry.camera import pinhole
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


def canonical() -> Canonical:
    """Five frames of random corrections on a picture."""
    picture = InputImage(
        rgb=torch.rand(32, 32, 3), camera=pinhole(30.0, (32, 32)), focal_source="test"
    )
    cameras = picture.camera.with_pose(torch.eye(4).expand(5, 4, 4))
    maps = RawGaussianMaps(
        gaussians=torch.randn(1, 12, 5, 32, 32), tokens=torch.randn(1, 24, 2, 2, 2)
    )
    return reconstruct(maps, plane_base(picture.rgb, picture.camera, cameras, 1), CONFIG.activation)


def moving_network() -> DeformationNetwork:
    torch.manual_seed(1)
    network = DeformationNetwork(CONFIG)
    for parameter in network.heads.parameters():
        parameter.data = torch.randn(parameter.shape)
    return network


def test_pruning_keeps_the_cells_of_what_it_keeps() -> None:
    whole = canonical()
    log = RunLog()
    pruned = prune_cells(whole, 0.01, log)
    assert 0 < len(pruned.cells) < len(whole.cells)
    assert torch.equal(pruned.gaussians.means, whole.gaussians.means[pruned.cells])
    assert float(pruned.gaussians.opacities.min()) >= 0.01
    (omission,) = log.skipped
    assert omission.error > 1 / 255, "what a renderer would have drawn is an error"


def test_dropping_what_no_renderer_draws_costs_nothing() -> None:
    log = RunLog()
    prune_cells(canonical(), 1 / 255, log)
    assert [omission.error for omission in log.skipped] == [0.0]


@torch.no_grad()
def test_deforming_what_is_left_is_what_is_left_of_the_deformed() -> None:
    whole, network = canonical(), moving_network()
    third = torch.arange(len(whole.cells)) % 3 == 1
    pruned = replace(whole, gaussians=whole.gaussians.select(third), cells=whole.cells[third])
    of_all = deform(network, whole, KEY_TIMES_S, UNITS, RunLog())
    of_some = deform(network, pruned, KEY_TIMES_S, UNITS, RunLog())
    assert isinstance(of_all, KeyframeMotion)
    for name in ("offsets", "rotations", "log_scale_offsets"):
        torch.testing.assert_close(getattr(of_some, name), getattr(of_all, name)[:, pruned.cells])


def test_a_network_that_cannot_move_anything_is_not_run() -> None:
    network, log = DeformationNetwork(CONFIG), RunLog()
    network.register_forward_pre_hook(lambda *_: (_ for _ in ()).throw(AssertionError("it ran")))
    motion = deform(network, canonical(), KEY_TIMES_S, UNITS, log)
    assert isinstance(motion, StaticMotion)
    assert motion.time_range_s == (0.0, 2.0)
    assert [omission.what for omission in log.skipped] == ["deformation network"]


def test_what_the_video_model_tells_is_added() -> None:
    whole, told = canonical(), torch.zeros(3, 32, 32, 3)
    told[1, :, 16:, 0], told[2, :, 16:, 0] = 1.0, 4.0
    plain = deform(moving_network(), whole, KEY_TIMES_S, UNITS, RunLog())
    motion = deform(moving_network(), whole, KEY_TIMES_S, UNITS, RunLog(), told)
    more = (motion.offsets - plain.offsets).unflatten(1, (5, 32, 32))
    torch.testing.assert_close(more[:, 0], told, atol=1e-5, rtol=0)
    assert not bool(more[:, 1:].any()), "later frames are where they were seen"


def test_told_motion_moves_what_no_network_does_and_blends_in_time() -> None:
    whole, told = canonical(), torch.zeros(2, 32, 32, 3)
    told[1, 3, 5] = torch.tensor([1.0, 2.0, -3.0])
    motion = deform(DeformationNetwork(CONFIG), whole, KEY_TIMES_S, UNITS, RunLog(), told)
    assert isinstance(motion, KeyframeMotion)
    found = motion.offsets[:, 3 * 32 + 5]
    torch.testing.assert_close(found, torch.tensor([[0.0] * 3, [0.5, 1, -1.5], [1, 2, -3]]))
    assert int((motion.offsets.abs().sum((0, 2)) > 0).sum()) == 1


def test_told_motion_alone_needs_no_network() -> None:
    whole, told = canonical(), torch.zeros(2, 32, 32, 3)
    told[1, 3, 5] = torch.tensor([1.0, 2.0, -3.0])
    alone = motion_from_offsets(whole, KEY_TIMES_S, told)
    asked = deform(DeformationNetwork(CONFIG), whole, KEY_TIMES_S, UNITS, RunLog(), told)
    torch.testing.assert_close(alone.offsets, asked.offsets)
    torch.testing.assert_close(alone.rotations, asked.rotations)
    torch.testing.assert_close(alone.log_scale_offsets, asked.log_scale_offsets)
