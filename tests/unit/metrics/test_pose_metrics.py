import math

import numpy as np
import oracles_metrics as oracle
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.geometry import quaternion, rigid
from diff4splat.metrics.pose import align_path, path_error

F64 = torch.float64
TINY = 1e-6


def random_path(count: int = 6, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    rotations = quaternion.to_matrix(torch.randn(count, 4, dtype=F64, generator=generator))
    return rigid.from_parts(rotations, torch.randn(count, 3, dtype=F64, generator=generator))


def straight_path(count: int = 5) -> torch.Tensor:
    path = torch.eye(4, dtype=F64).repeat(count, 1, 1)
    path[:, 2, 3] = torch.arange(count)
    return path


def elsewhere(path: torch.Tensor, scale: float, seed: int) -> torch.Tensor:
    """The same path in a world that is turned, moved and scaled."""
    pose = random_path(1, seed)[0]
    moved = path.clone()
    moved[:, :3, 3] *= scale
    return pose @ moved


@settings(max_examples=25, deadline=None)
@given(scale=st.floats(1e-3, 1e3), seed=st.integers(1, 999))
def test_another_world_is_no_error(scale: float, seed: int) -> None:
    for truth in (random_path(seed=seed), straight_path(), random_path(2, seed)):
        error = path_error(elsewhere(truth, scale, seed + 1), truth)
        assert error.absolute_translation < TINY
        assert error.absolute_rotation_deg < TINY
        assert error.relative_translation < TINY
        assert error.relative_rotation_deg < TINY
        assert error.scale == pytest.approx(1 / scale)


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_alignment_is_the_best_there_is(mirrored: bool) -> None:
    estimated, truth = random_path(seed=1), random_path(seed=2)
    if mirrored:
        # Fits best by a reflection, which no camera can do.
        estimated = truth.clone()
        estimated[:, 0, 3] *= -1
    got = path_error(estimated, truth).absolute_translation
    best = oracle.umeyama_by_search(estimated[:, :3, 3].numpy(), truth[:, :3, 3].numpy())
    assert got == pytest.approx(best, rel=1e-5)
    assert torch.linalg.det(align_path(estimated, truth, "rigid").rotation) == pytest.approx(1)


def test_errors_against_loops() -> None:
    estimated, truth = random_path(seed=1).numpy(), random_path(seed=2).numpy()
    error = path_error(torch.from_numpy(estimated), torch.from_numpy(truth), "none")

    def rms(values: list[float]) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    absolute = [np.linalg.inv(t) @ e for e, t in zip(estimated, truth, strict=True)]
    relative = []
    for i in range(len(truth) - 1):
        own = np.linalg.inv(estimated[i]) @ estimated[i + 1]
        relative.append(np.linalg.inv(np.linalg.inv(truth[i]) @ truth[i + 1]) @ own)
    for found, translation, rotation in (
        (absolute, error.absolute_translation, error.absolute_rotation_deg),
        (relative, error.relative_translation, error.relative_rotation_deg),
    ):
        assert translation == pytest.approx(rms([np.linalg.norm(m[:3, 3]) for m in found]))
        angles = [oracle.quaternion_angle_deg(np.eye(3), m[:3, :3]) for m in found]
        assert rotation == pytest.approx(rms(angles))


@pytest.mark.parametrize("angle_deg", [1e-9, 1e-4, 90.0, 179.9999, 180.0])
def test_angles_are_exact_at_both_ends(angle_deg: float) -> None:
    truth = straight_path(2)
    turn = quaternion.from_axis_angle(
        torch.tensor([1.0, 2.0, -1.0], dtype=F64), torch.tensor(math.radians(angle_deg), dtype=F64)
    )
    estimated = truth.clone()
    estimated[1, :3, :3] = quaternion.to_matrix(turn)
    error = path_error(estimated, truth, "none")
    assert error.relative_rotation_deg == pytest.approx(angle_deg, rel=1e-6, abs=1e-12)


def test_scale_is_kept_without_permission() -> None:
    truth = random_path()
    doubled = elsewhere(truth, 2.0, 5)
    rigid_error = path_error(doubled, truth, "rigid")
    assert rigid_error.scale == 1
    steps = torch.linalg.inv(truth[:-1]) @ truth[1:]
    expected = float(steps[:, :3, 3].square().sum(-1).mean().sqrt())
    assert rigid_error.relative_translation == pytest.approx(expected)


def test_a_camera_that_stands_still() -> None:
    still = straight_path()
    still[:, :3, 3] = 1.5
    trembling = still.clone()
    trembling[:, :3, 3] += 1e-15 * torch.randn(5, 3, dtype=F64)
    assert path_error(trembling, straight_path()).scale == 1
    for estimated, truth in ((still, still), (still, straight_path()), (straight_path(), still)):
        error = path_error(estimated, truth)
        assert error.scale == 1
        assert error.relative_rotation_deg < TINY
        assert math.isfinite(error.absolute_translation)
    assert path_error(still, still).absolute_translation < TINY


def test_a_path_that_goes_backwards_keeps_its_scale() -> None:
    truth = straight_path()
    backwards = truth.clone()
    backwards[:, 2, 3] *= -1
    error = path_error(backwards, truth)
    assert error.scale == 1
    assert error.relative_translation == pytest.approx(2)


def test_single_precision_paths_are_measured_in_double() -> None:
    truth = random_path()
    error = path_error(truth.float(), truth, "rigid")
    assert error.absolute_rotation_deg < 1e-4


@pytest.mark.usefixtures("as_shipped")
def test_paths_that_cannot_be_measured() -> None:
    path = straight_path()
    with pytest.raises(InputError, match="expected at least two poses, got 1"):
        path_error(path[:1], path[:1])
    with pytest.raises(ShapeError, match=r"estimated: expected \(5, 4, 4\), got \(4, 4, 4\)"):
        path_error(path[:4], path)
    with pytest.raises(ConfigError, match="expected one of none, rigid, similarity, got 'sim3'"):
        path_error(path, path, "sim3")
    broken = path.clone()
    broken[2, 0, 0] = math.nan
    with pytest.raises(InputError, match="estimated: expected finite rotations without scale"):
        path_error(broken, path)
    with pytest.raises(InputError, match="truth: expected finite rotations without scale"):
        path_error(path, 2 * path)
    broken = path.clone()
    broken[:, 0] *= -1
    with pytest.raises(InputError, match="truth: expected right-handed rotations"):
        path_error(path, broken)
