"""Camera paths that are filmed through optics."""

import math

import torch
from filmed_scenes import filmed_scene

from diff4splat.geometry.optics import Optics, Shutter
from diff4splat.paths.physical_path import PhysicalPath, filmed


def test_what_is_filmed_is_exact_and_goes_on_between_frames() -> None:
    path = filmed_scene(3).path
    own = filmed(path, Optics(shutter=Shutter(readout_s=0.05)))
    assert len(own) == 3
    assert own.path.times_s.dtype == own.track.times_s.dtype == torch.float64
    assert torch.equal(own.path.times_s.float(), path.times_s)
    between = (own.path.times_s[0] + own.path.times_s[1])[None] / 2
    middle = own.track.at(between)[0, :3, 3]
    torch.testing.assert_close(middle, own.path.cameras.position[:2].mean(0))
    camera = own.camera(2)
    assert camera.track is own.track
    assert camera.optics is own.optics
    assert torch.equal(camera.camera.world_from_camera, own.path.cameras.world_from_camera[2])
    assert own.time_s(2) == float(path.times_s[2])


def test_the_shortest_step_counts_and_one_frame_has_none() -> None:
    path = filmed_scene(3).path
    uneven = PhysicalPath(path=type(path)(cameras=path.cameras, times_s=torch.tensor([0, 1.0, 4])))
    assert uneven.frame_s == 1.0
    assert filmed(filmed_scene(1).path, Optics()).frame_s == math.inf
