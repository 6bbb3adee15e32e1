import numpy as np
import pytest

from diff4splat.captions.vocabulary import VERBS
from diff4splat.data_prep.synthetic.motions.context import (
    MotionContext,
    MotionResult,
    articulated,
    axis_rotations,
)
from diff4splat.data_prep.synthetic.motions.registry import MOTIONS, families_for
from diff4splat.data_prep.synthetic.rng import Rng
from diff4splat.data_prep.synthetic.shapes.registry import FAMILIES

TIMES = np.arange(17) / 8.0
FINE = np.arange(161) / 80.0


def size_for(motion: str, family: str) -> float:
    low, high = MOTIONS[motion].heights_m
    fitting = [(max(a, low), min(b, high)) for a, b in FAMILIES[family].heights_m]
    return next(0.5 * (a + b) for a, b in fitting if a <= b)


def performance(motion: str, family: str, times_s: np.ndarray = TIMES) -> MotionResult:
    height = size_for(motion, family)
    shape = FAMILIES[family].make(Rng("s", family)).of_height(height)
    act = MotionContext(shape=shape, times_s=times_s, travel_m=2.5 * height, rng=Rng("a", motion))
    return MOTIONS[motion].perform(act)


def everything(done: MotionResult) -> np.ndarray:
    return np.concatenate(done.parts, axis=1)


@pytest.mark.parametrize("motion", MOTIONS)
def test_finite_above_ground_and_moving(motion: str) -> None:
    for family in families_for(motion)[:4]:
        done = performance(motion, family)
        points = everything(done)
        height = size_for(motion, family)
        assert len(done.parts) == len(done.shape.parts)
        assert points.shape[0] == 17 and np.isfinite(points).all()
        assert points[..., 1].max() < 1e-9
        reach = np.linalg.norm(points - points[:1], axis=-1).max(0)
        assert np.percentile(reach, 99.5) > 0.035 * max(height, 0.5 * done.shape.radius), family


@pytest.mark.parametrize("motion", MOTIONS)
def test_continuous(motion: str) -> None:
    family = families_for(motion)[0]
    coarse, fine = (
        everything(performance(motion, family)),
        everything(performance(motion, family, FINE)),
    )
    step = np.linalg.norm(np.diff(coarse, axis=0), axis=-1).max()
    small = np.linalg.norm(np.diff(fine, axis=0), axis=-1).max()
    assert small < 0.35 * step + 1e-6


@pytest.mark.parametrize("motion", [name for name, motion in MOTIONS.items() if motion.travels])
def test_what_travels_goes_along_x_by_about_the_travel(motion: str) -> None:
    for family in families_for(motion)[:3]:
        way = np.diff(everything(performance(motion, family))[[0, -1]].mean(1), axis=0)[0]
        assert way[0] > 1.2 * size_for(motion, family)
        assert abs(way[2]) < 0.35 * way[0]


def test_rolling_does_not_slip() -> None:
    done = performance("rolls", "ball", FINE)
    points = everything(done)
    lowest = points[..., 1].argmax(1)
    frames = np.arange(len(points) - 1)
    slip = points[frames + 1, lowest[:-1], 0] - points[frames, lowest[:-1], 0]
    pace = np.abs(np.diff(points.mean(1)[:, 0])).max()
    assert np.abs(slip).max() < 0.25 * pace


def test_tumbling_does_not_slip() -> None:
    points = everything(performance("tumbles", "box", FINE))
    lowest = points[..., 1].argmax(1)
    frames = np.arange(len(points) - 1)
    slip = points[frames + 1, lowest[:-1], 0] - points[frames, lowest[:-1], 0]
    assert np.abs(slip).max() < 0.2 * np.abs(np.diff(points.mean(1)[:, 0])).max()


def test_falling_follows_gravity() -> None:
    points = everything(performance("drops", "box", FINE))
    height = -points[..., 1].max(1)
    speed = np.diff(height[:8]) * 80
    assert np.diff(speed) * 80 == pytest.approx(-9.81, rel=1e-6)
    assert height[-1] == pytest.approx(0.0, abs=1e-9)


def test_squashing_keeps_the_volume() -> None:
    points = everything(performance("squashes", "box"))
    extent = np.ptp(points, axis=1).prod(1)
    assert extent == pytest.approx(extent[0], rel=1e-9)


def test_cloth_moves_and_its_pole_does_not() -> None:
    done = performance("flutters", "flag")
    moved = {
        part.role: float(np.abs(np.ptp(at, axis=0)).max())
        for part, at in zip(done.shape.parts, done.parts, strict=True)
    }
    assert moved["metal"] == 0.0
    assert moved["cloth"] > 0.05


def test_joints_carry_their_children() -> None:
    shape = FAMILIES["robot_arm"].make(Rng("r"))
    quarter = np.array([0.0, np.pi / 2])
    still, turned = articulated(shape, {2: quarter}, 2)[0]
    hand = shape.parts[0].surface.joint == 3
    pivot = np.array(shape.joints[1].pivot)
    away = np.linalg.norm(still[hand] - pivot, axis=1), np.linalg.norm(turned[hand] - pivot, axis=1)
    assert away[0] == pytest.approx(away[1])
    foot = shape.parts[0].surface.joint == 1
    assert np.allclose(still[foot], turned[foot])


def test_turning_is_a_rotation_about_its_axis() -> None:
    turn = axis_rotations((0.0, 0.0, 1.0), np.array([np.pi / 2]))[0]
    assert np.allclose(turn, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])


def test_every_motion_has_words_and_somebody_to_do_it() -> None:
    assert len(MOTIONS) >= 12
    assert set(VERBS) == set(MOTIONS)
    assert all(families_for(motion) for motion in MOTIONS)
