"""Lines that are read one after another: constant velocity turns an edge into a sloped line.

The edge is one Gaussian as long as the image. With v pixels per second and read-out t1 - t0 its
centre moves v (t1 - t0) / (H - 1) pixels from row to row.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from oracles_chunks import constant_error_px
from oracles_physical import SHARP, camera_of, dots, drifting, keyed, row_centers, shot

from diff4splat.geometry.optics import Optics, Shutter
from diff4splat.geometry.pose_track import PoseTrack
from diff4splat.render.trace.settings import TraceSettings
from diff4splat.scene.gaussians import Gaussians

FAINT = replace(SHARP, trace=TraceSettings(alpha_cutoff=1e-6))
FOCAL, DEPTH, READOUT = 100.0, 4.0, 0.02
PX_PER_S = 400.0
SPEED = PX_PER_S * DEPTH / FOCAL
REVERSED = ("bottom-to-top", "right-to-left")


def edge(along: int) -> Gaussians:
    """A line of 1.5 pixels' deviation along x (0) or y (1)."""
    one = dots([(0, 0, DEPTH)], 0.06)
    scales = one.scales.clone()
    scales[0, along] = 1e3
    return replace(one, scales=scales)


def rolling(direction: str = "top-to-bottom", readout_s: float = READOUT, **others) -> Optics:
    return Optics(shutter=Shutter(readout_s=readout_s, direction=direction), **others)


@pytest.mark.parametrize("timestamp", ["middle", "start"])
@pytest.mark.parametrize(
    "direction", ["top-to-bottom", "bottom-to-top", "left-to-right", "right-to-left"]
)
def test_an_edge_becomes_a_sloped_line(direction: str, timestamp: str) -> None:
    by_row = direction in ("top-to-bottom", "bottom-to-top")
    velocity = (SPEED, 0, 0) if by_row else (0, SPEED, 0)
    scene, camera = drifting(edge(1 if by_row else 0), velocity), camera_of((33, 41))
    made = shot(scene, camera, rolling(direction, timestamp=timestamp), FAINT, outputs=("alpha",))
    image = made.alpha if by_row else made.alpha.T
    count = len(image)
    shares = np.arange(count) / (count - 1)
    if direction in REVERSED:
        shares = shares[::-1]
    start_s = -READOUT / 2 if timestamp == "middle" else 0.0
    middle = 20.5 if by_row else 16.5
    want = middle + PX_PER_S * (start_s + shares * READOUT)
    np.testing.assert_allclose(row_centers(image), want, atol=0.02)
    slope = np.polyfit(np.arange(count), row_centers(image), 1)[0]
    sign = -1 if direction in REVERSED else 1
    assert slope == pytest.approx(sign * PX_PER_S * READOUT / (count - 1), rel=5e-3)
    assert made.skipped_effects == ()


@pytest.mark.parametrize("direction", ["top-to-bottom", "right-to-left"])
def test_times_of_pixels_are_told(direction: str) -> None:
    scene = drifting(edge(1), (1.0, 0, 0))
    made = shot(scene, camera_of((3, 5)), rolling(direction, 0.2), outputs=("time_s",)).time_s
    if direction == "top-to-bottom":
        want = torch.tensor([-0.1, 0.0, 0.1])[:, None].expand(3, 5)
    else:
        want = torch.tensor([0.1, 0.05, 0.0, -0.05, -0.1]).expand(3, 5)
    torch.testing.assert_close(made, want, rtol=0, atol=1e-7)


def test_a_still_scene_is_unchanged_and_the_shutter_left_out() -> None:
    cloud, camera = dots([(0, 0, 4), (0.2, 0.3, 5)], 0.1), camera_of()
    made = shot(cloud, camera, rolling(), backend="trace")
    assert torch.equal(made.rgb, shot(cloud, camera, backend="trace").rgb)
    assert made.skipped_effects == ("read-out: neither scene nor camera moves meanwhile",)
    drawn = shot(cloud, camera, rolling())
    assert drawn.backend == "raster"


def test_chunks_of_eight_rows_are_within_their_bound_of_single_rows() -> None:
    # A motion that goes back and forth, so that chunks matter.
    times = [0.01 * k for k in range(-3, 4)]
    offsets = torch.tensor([[[0.16 * math.cos(2.5 * k), 0, 0]] for k in range(7)])
    scene, camera = keyed(edge(1), times, offsets, interpolation="cubic"), camera_of((25, 41))
    lines = {
        rows: row_centers(shot(scene, camera, rolling(), replace(FAINT, rows_per_chunk=rows)).alpha)
        for rows in (1, 8)
    }
    fine = shot(scene, camera, rolling(), replace(FAINT, tolerance_px=0.02)).alpha
    speed_px = float(np.abs(np.diff(row_centers(fine))).max()) * 24 / READOUT
    assert speed_px * READOUT > 4
    bound = constant_error_px(speed_px, 8, READOUT, 25)
    assert np.abs(lines[1] - lines[8]).max() < bound
    np.testing.assert_allclose(lines[1], row_centers(fine), atol=0.03)


def test_straight_motion_needs_no_chunks() -> None:
    ends = torch.tensor([[[-0.2, 0, 0]], [[0.2, 0, 0]]])
    scene, camera = keyed(edge(1), [-0.05, 0.05], ends), camera_of((33, 41))
    images = [
        shot(scene, camera, rolling(), replace(FAINT, rows_per_chunk=rows)).alpha
        for rows in (1, 7, 33, None)
    ]
    for image in images[1:]:
        torch.testing.assert_close(image, images[0], rtol=0, atol=2e-5)
    want = 20.5 + FOCAL / DEPTH * 4.0 * READOUT * (np.arange(33) / 32 - 0.5)
    np.testing.assert_allclose(row_centers(images[0]), want, atol=0.02)


def test_a_moving_camera_is_a_scene_that_moves_the_other_way() -> None:
    cloud, camera = dots([(0, 0, 4), (0.2, 0.3, 5), (-0.4, -0.2, 4.5)], 0.06), camera_of()
    poses = torch.eye(4).repeat(2, 1, 1)
    poses[:, 0, 3], poses[:, 1, 3] = torch.tensor([-0.4, 0.4]), torch.tensor([0.1, -0.1])
    track = PoseTrack(times_s=torch.tensor([-0.05, 0.05]), world_from_camera=poses)
    by_camera = shot(cloud, camera, rolling(), FAINT, track=track)
    by_scene = shot(drifting(cloud, (-8.0, 2.0, 0.0)), camera, rolling(), FAINT)
    torch.testing.assert_close(by_camera.alpha, by_scene.alpha, rtol=0, atol=1e-4)
    still = shot(cloud, camera, None, FAINT, backend="trace")
    assert float((by_camera.alpha - still.alpha).abs().max()) > 0.2


def test_a_turning_camera_shears_what_is_far_away() -> None:
    rate = 2.0
    angles = torch.tensor([-0.05 * rate, 0.05 * rate], dtype=torch.float64)
    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[:, 0, 0] = poses[:, 2, 2] = angles.cos()
    poses[:, 0, 2], poses[:, 2, 0] = angles.sin(), -angles.sin()
    track = PoseTrack(
        times_s=torch.tensor([-0.05, 0.05], dtype=torch.float64), world_from_camera=poses
    )
    made = shot(edge(1), camera_of((33, 41)), rolling(), FAINT, track=track)
    want = 20.5 - FOCAL * np.tan(rate * READOUT * (np.arange(33) / 32 - 0.5))
    np.testing.assert_allclose(row_centers(made.alpha), want, atol=0.02)


def test_far_from_time_zero_rows_keep_their_times() -> None:
    late = 1e6
    scene = drifting(edge(1), (SPEED, 0, 0), time_range_s=(late - 10, late + 10), center_s=late)
    made = shot(scene, camera_of(), rolling(), FAINT, time_s=late, outputs=("alpha", "time_s"))
    early = shot(drifting(edge(1), (SPEED, 0, 0)), camera_of(), rolling(), FAINT,
                 outputs=("alpha", "time_s"))  # fmt: skip
    torch.testing.assert_close(made.time_s, early.time_s, rtol=0, atol=1e-9)
    torch.testing.assert_close(made.alpha, early.alpha, rtol=0, atol=1e-5)


def test_an_image_of_one_row_is_read_in_the_middle() -> None:
    scene, camera = drifting(edge(1), (SPEED, 0, 0)), camera_of((1, 41))
    made = shot(scene, camera, rolling(timestamp="start"), FAINT, outputs=("alpha", "time_s"))
    torch.testing.assert_close(made.time_s, torch.full((1, 41), READOUT / 2))
    assert row_centers(made.alpha)[0] == pytest.approx(20.5 + PX_PER_S * READOUT / 2, abs=0.02)
