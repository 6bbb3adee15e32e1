"""Intervals of time: Gaussians that go straight in each are within the tolerance of the truth."""

import math
from dataclasses import replace

import oracles_hexplane
import pytest
import torch
from oracles_physical import SHARP, camera_of, dots, drifting, keyed, scene_of, shot
from torch import Tensor

from diff4splat.geometry.lenses.build import equirectangular_camera
from diff4splat.geometry.lenses.equirectangular import Equirectangular
from diff4splat.geometry.optics import Optics, Shutter
from diff4splat.geometry.physical_camera import PhysicalCamera
from diff4splat.render.physical.intervals import Intervals, choose_intervals
from diff4splat.render.physical.settings import PhotoSettings
from diff4splat.render.physical.view_cone import view_cone
from diff4splat.scene.scene import Scene

READOUT = 0.1


def chosen(scene: Scene, time_s: float, focal_px: float = 60.0, **settings) -> Intervals:
    camera = physical(focal_px)
    cone = view_cone(camera, time_s)
    return choose_intervals(scene, camera, time_s, cone, PhotoSettings(**settings))


def physical(focal_px: float = 60.0) -> PhysicalCamera:
    optics = Optics(shutter=Shutter(readout_s=READOUT))
    return PhysicalCamera(camera=camera_of((64, 64), focal_px), optics=optics)


def ahead(count: int, seed: int) -> Tensor:
    """Places in the view of `physical`."""
    generator = torch.Generator().manual_seed(seed)
    numbers = torch.rand(count, 3, generator=generator)
    depth = 2 + 4 * numbers[:, 2:]
    return torch.cat([0.9 * (numbers[:, :2] - 0.5) * depth, depth], 1)


def random_keys(seed: int, interpolation: str) -> Scene:
    """Keys a third of a read-out apart, so that there are bows and corners."""
    generator = torch.Generator().manual_seed(seed)
    count = 30
    cloud = replace(dots([(0, 0, 1)] * count, 0.05), means=ahead(count, seed))
    offsets = 0.15 * torch.randn(7, count, 3, generator=generator)
    turns = torch.nn.functional.normalize(
        torch.tensor([2.0, 0, 0, 0]) + 0.3 * torch.randn(7, count, 4, generator=generator), dim=-1
    )
    stretches = 0.1 * torch.randn(7, count, 3, generator=generator)
    times = [0.033 * k - 0.1 for k in range(7)]
    return keyed(cloud, times, offsets, turns, stretches, interpolation)


def random_field(seed: int) -> Scene:
    """A HexPlane field in the view of the camera, with position, turn, scale and opacity."""
    torch.manual_seed(seed)
    size = oracles_hexplane.HexPlaneSize(space=(4, 4, 4), time=8, channels=16)
    box = torch.tensor([[-2.0, -2, 2], [2, 2, 6]])
    planes = oracles_hexplane.random_planes(size, torch.float32, box)
    size = oracles_hexplane.DecoderSize(
        width=8, depth=2, heads=("position", "rotation", "scale"), coefficients=1
    )
    decoder = oracles_hexplane.make_decoder(planes.feature_count, size, zero_heads=False)
    hidden, last = decoder.heads["position"]
    far = replace(last, weight=20 * last.weight)
    motion = oracles_hexplane.HexPlaneMotion(
        planes=planes,
        decoder=replace(decoder, heads={**decoder.heads, "position": (hidden, far)}),
        moving_index=torch.arange(0, 30, 2),
    )
    cloud = replace(dots([(0, 0, 1)] * 30, 0.05), means=ahead(30, seed))
    return scene_of(cloud, motion)


def displacements_px(scene: Scene, intervals: Intervals, time_s: float, focal_px: float) -> Tensor:
    """True pixels next to those on the line, at random times, of what is in the image."""
    generator = torch.Generator().manual_seed(99)
    found = []
    for first, last in intervals.spans():
        ends = [scene.state_at(time_s + at).means for at in (first, last)]
        for share in torch.rand(6, generator=generator).tolist():
            true = scene.state_at(time_s + first + share * (last - first)).means
            made = torch.lerp(*ends, share)
            places = [focal_px * m[:, :2] / m[:, 2:] for m in (true, made)]
            inside = (places[0].abs() <= 32).all(1) & (true[:, 2] > 0.5)
            found.append((places[0] - places[1]).norm(dim=1)[inside])
    return torch.cat(found)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", ["linear", "cubic", "field"])
@pytest.mark.parametrize("tolerance_px", [0.1, 0.5])
def test_things_are_where_they_should_be(kind: str, seed: int, tolerance_px: float) -> None:
    scene, time_s = (random_field(seed), 2.0) if kind == "field" else (random_keys(seed, kind), 0.0)
    made = chosen(scene, time_s, tolerance_px=tolerance_px)
    assert made.error_px <= tolerance_px
    off = displacements_px(scene, made, time_s, 60.0)
    # Between probes a bow may be a little higher.
    assert float(off.max()) < 1.2 * tolerance_px
    assert float((off > tolerance_px).float().mean()) < 0.01
    if kind == "cubic" and tolerance_px == 0.1:
        assert len(made) > 4


def test_an_s_that_crosses_its_line_in_the_middle_is_not_missed() -> None:
    # A cubic with level ends, 3 w² - 2 w³: at w = ½ it is on the line.
    offsets = torch.tensor([0.0, 0.0, 1.0, 1.0])[:, None, None] * torch.tensor([1.0, 0, 0])
    times = [-0.15, -0.05, 0.05, 0.15]
    scene = keyed(dots([(-0.5, 0, 4)], 0.05), times, offsets, interpolation="cubic")
    made = chosen(scene, 0.0)
    assert len(made) > 2
    assert float(displacements_px(scene, made, 0.0, 60.0).max()) < 0.12


def test_key_times_are_ends_of_intervals() -> None:
    offsets = torch.tensor([0.0, 1.0, 0.0])[:, None, None] * torch.tensor([0.2, 0, 0])
    scene = keyed(dots([(0, 0, 4)], 0.05), [0.98, 1.013, 1.1], offsets)
    made = chosen(scene, 1.0)
    assert made.edges_s == pytest.approx((-0.05, -0.02, 0.013, 0.05), abs=1e-6)
    assert made.error_px < 1e-4


def test_native_gaussians_need_one() -> None:
    scene = drifting(dots([(0, 0, 4)]), (50.0, 0, 0))
    made = chosen(scene, 0.0)
    assert made.edges_s == (-0.05, 0.05)
    assert made.error_px == 0.0


def test_colours_that_wave_are_as_near_as_the_tolerance() -> None:
    own = drifting(dots([(0, 0, 4)], 0.2), (0, 0, 0), deviation_s=0.01)
    waves = torch.full((1, 1, 1, 3), 1.5)
    scene = scene_of(own.gaussians, replace(own.motion, color_waves=waves, period_s=READOUT))
    made = chosen(scene, 0.0)
    assert 4 < len(made) < 100
    for first, last in made.spans():
        ends = [scene.state_at(at).sh for at in (first, last)]
        for share in (0.0, 0.2, 0.5, 0.9):
            true = scene.state_at(first + share * (last - first)).sh
            off = (true - 0.5 * (ends[0] + ends[1])).abs().max() * 0.28209479
            assert float(off) < 0.12
    # The pulse, a tenth as long as the read-out, is seen at its time whatever the intervals.
    lit = shot(scene, camera_of((33, 9)), physical().optics, SHARP, outputs=("alpha",)).alpha
    seconds = READOUT * (torch.arange(33) / 32 - 0.5)
    want = 0.9 * torch.exp(-0.5 * (seconds / 0.01) ** 2)
    want = torch.where(seconds.abs() < 0.0244, want, 0.0)
    still = shot(own.gaussians, camera_of((33, 9)), None, SHARP, outputs=("alpha",),
                 backend="trace").alpha  # fmt: skip
    torch.testing.assert_close(lit[:, 4], want * still[:, 4] / 0.9, rtol=0, atol=5e-3)


def test_a_change_of_opacity_splits_time() -> None:
    scene = blinking()
    made = chosen(scene, 2.0)
    for first, last in made.spans():
        ends = [scene.state_at(2.0 + at).opacities for at in (first, last)]
        assert float((ends[0] - ends[1]).abs().max()) <= 0.2 + 1e-6


def blinking() -> Scene:
    """A field that changes opacities alone, and much."""
    planes = oracles_hexplane.random_planes(
        oracles_hexplane.HexPlaneSize(space=(4, 4, 4), time=40, channels=16),
        torch.float32,
        torch.tensor([[-2.0, -2, 2], [2, 2, 6]]),
    )
    size = oracles_hexplane.DecoderSize(width=8, depth=1, heads=("opacity",), coefficients=1)
    decoder = oracles_hexplane.make_decoder(planes.feature_count, size, zero_heads=False)
    last = decoder.heads["opacity"][1]
    heads = {"opacity": (decoder.heads["opacity"][0], replace(last, weight=30 * last.weight))}
    motion = oracles_hexplane.HexPlaneMotion(
        planes=planes, decoder=replace(decoder, heads=heads), moving_index=torch.arange(10)
    )
    return scene_of(replace(dots([(0, 0, 1)] * 10, 0.05), means=ahead(10, 0)), motion)


def test_what_the_camera_does_not_see_splits_nothing() -> None:
    scene = random_keys(0, "cubic")
    behind = replace(scene.gaussians, means=scene.gaussians.means * torch.tensor([1.0, 1, -1]))
    kinks = 2
    assert len(chosen(replace(scene, gaussians=behind), 0.0)) <= 1 + kinks + 1
    faint = replace(scene.gaussians, opacities=torch.full((30,), 1e-3))
    assert len(chosen(replace(scene, gaussians=faint), 0.0)) <= 1 + kinks + 1
    assert len(chosen(scene, 0.0)) > 4


def test_a_camera_that_sees_all_around_sees_what_is_behind() -> None:
    scene = random_keys(0, "cubic")
    behind = replace(scene.gaussians, means=scene.gaussians.means * torch.tensor([1.0, 1, -1]))
    optics = Optics(lens=Equirectangular(), shutter=Shutter(readout_s=READOUT))
    camera = PhysicalCamera(camera=equirectangular_camera((64, 128)), optics=optics)
    made = choose_intervals(
        replace(scene, gaussians=behind), camera, 0.0, view_cone(camera, 0.0), PhotoSettings()
    )
    assert len(made) > 4


def test_what_a_long_thin_gaussian_does_is_seen_from_where_it_is() -> None:
    wave = torch.tensor([math.cos(2.5 * k) for k in range(7)])[:, None, None]
    offsets = wave * torch.tensor([0.2, 0, 0])
    times = [0.033 * k - 0.1 for k in range(7)]
    long = replace(dots([(0, 0, 4)], 0.05), scales=torch.tensor([[0.05, 1e4, 0.05]]))
    made = chosen(keyed(long, times, offsets, interpolation="cubic"), 0.0)
    short = chosen(keyed(dots([(0, 0, 4)], 0.05), times, offsets, interpolation="cubic"), 0.0)
    assert made.edges_s == short.edges_s


def test_no_more_than_the_most_and_what_is_left_is_told() -> None:
    scene = random_keys(0, "cubic")
    capped, free = chosen(scene, 0.0, most_intervals=5), chosen(scene, 0.0)
    assert len(capped) == 5 < len(free)
    assert capped.error_px > 0.1 >= free.error_px
    off = displacements_px(scene, capped, 0.0, 60.0)
    assert float(off.max()) < 1.2 * capped.error_px
    optics = physical().optics
    made = shot(scene, camera_of((5, 5), 60.0), optics, replace(SHARP, most_intervals=5))
    assert made.intervals == 5
    assert made.interval_error_px > 0.1


def test_chunks_of_rows_end_halfway_between_rows() -> None:
    made = chosen(random_keys(0, "cubic"), 0.0, rows_per_chunk=20)
    line_s = READOUT / 63
    want = [-0.05, *(-0.05 + (k - 0.5) * line_s for k in (20, 40, 60)), 0.05]
    assert made.edges_s == pytest.approx(tuple(want))
    assert made.error_px > 0.1


def test_times_find_their_interval() -> None:
    own = Intervals((-1.0, 0.0, 0.5, 2.0), 0.0)
    times = torch.tensor([-5.0, -1.0, -0.1, 0.0, 0.4, 0.5, 2.0, 9.0])
    assert own.of(times).tolist() == [0, 0, 0, 1, 1, 2, 2, 2]
    assert own.spans() == [(-1.0, 0.0), (0.0, 0.5), (0.5, 2.0)]
    assert Intervals((1.0, 1.0), 0.0).spans() == [(1.0, 1.0)]
    assert len(own) == 3


def test_images_do_not_depend_on_the_order_of_intervals() -> None:
    # The same times in the reverse order of rows: every row by itself is that of its time.
    scene = random_keys(1, "cubic")
    camera = camera_of((16, 24), 20.0)
    down = shot(scene, camera, Optics(shutter=Shutter(readout_s=READOUT)), SHARP)
    assert down.intervals > 3
    times = READOUT * (torch.arange(16, dtype=torch.float64) / 15 - 0.5)
    for row in (0, 5, 15):
        frozen = shot(scene.state_at(float(times[row])), camera, None, SHARP, backend="trace")
        torch.testing.assert_close(down.rgb[row], frozen.rgb[row], rtol=0, atol=0.1)
        assert float((down.rgb[row] - frozen.rgb[row]).abs().mean()) < 0.01
