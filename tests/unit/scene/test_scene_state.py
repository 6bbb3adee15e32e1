"""Gaussians, harmonics and motions."""

from dataclasses import fields

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion
from diff4splat.scene import harmonics
from diff4splat.scene.gaussians import Gaussians, concatenate
from diff4splat.scene.motion.keyframes import KeyframeMotion
from diff4splat.scene.motion.protocol import Motion
from diff4splat.scene.motion.static import StaticMotion

F64 = torch.float64


def random_gaussians(count: int, coefficients: int = 1) -> Gaussians:
    return Gaussians(
        means=torch.randn(count, 3, dtype=F64),
        quats=quaternion.normalize(torch.randn(count, 4, dtype=F64)),
        scales=torch.rand(count, 3, dtype=F64),
        opacities=torch.rand(count, dtype=F64),
        sh=torch.randn(count, coefficients, 3, dtype=F64),
    )


def random_motion(
    times: list[float], index: list[int], interpolation: str = "linear"
) -> KeyframeMotion:
    shape = (len(times), len(index))
    return KeyframeMotion(
        key_times_s=torch.tensor(times, dtype=F64),
        moving_index=torch.tensor(index, dtype=torch.long),
        offsets=torch.randn(*shape, 3, dtype=F64),
        rotations=quaternion.normalize(torch.randn(*shape, 4, dtype=F64)),
        log_scale_offsets=torch.randn(*shape, 3, dtype=F64),
        interpolation=interpolation,
    )


def assert_same(left: Gaussians, right: Gaussians) -> None:
    for field in fields(Gaussians):
        torch.testing.assert_close(getattr(left, field.name), getattr(right, field.name))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_rotated_harmonics_look_the_same_from_the_rotated_direction(degree: int) -> None:
    sh = random_gaussians(5, harmonics.BAND_SIZES[degree]).sh
    rotation = quaternion.to_matrix(torch.randn(4, dtype=F64))
    directions = torch.nn.functional.normalize(torch.randn(5, 3, dtype=F64), dim=-1)
    turned = harmonics.color(harmonics.rotate(sh, rotation), directions @ rotation.mT)
    torch.testing.assert_close(turned, harmonics.color(sh, directions))


def test_harmonics_are_orthonormal() -> None:
    """∫ Y_i Y_j over the sphere is the identity (Gauss–Legendre in z, uniform in angle: exact)."""
    import numpy as np

    z, weight = np.polynomial.legendre.leggauss(8)
    angle = np.arange(16) / 16 * 2 * np.pi
    ring = np.sqrt(1 - z**2)[:, None]
    directions = np.stack(
        [ring * np.cos(angle), ring * np.sin(angle), np.broadcast_to(z[:, None], (8, 16))], -1
    )
    values = harmonics.basis(torch.tensor(directions.reshape(-1, 3)), 3)
    weights = torch.tensor(np.repeat(weight, 16) * 2 * np.pi / 16)
    torch.testing.assert_close(values.mT @ (weights[:, None] * values), torch.eye(16, dtype=F64))


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_keys_are_met_exactly_and_static_gaussians_stand_still(interpolation: str) -> None:
    still, motion = random_gaussians(6), random_motion([0.0, 0.5, 2.0, 2.1], [1, 4], interpolation)
    for key, time_s in enumerate(motion.key_times_s.tolist()):
        state = motion.state_at(still, time_s)
        torch.testing.assert_close(state.means[[1, 4]], still.means[[1, 4]] + motion.offsets[key])
        torch.testing.assert_close(
            state.scales[[1, 4]], still.scales[[1, 4]] * motion.log_scale_offsets[key].exp()
        )
        turned = quaternion.multiply(still.quats[[1, 4]], motion.rotations[key])
        torch.testing.assert_close(
            quaternion.to_matrix(state.quats[[1, 4]]), quaternion.to_matrix(turned)
        )
        assert_same(
            state.select(torch.tensor([0, 2, 3, 5])), still.select(torch.tensor([0, 2, 3, 5]))
        )


def test_linear_motion_is_linear_and_constant_outside_the_keys() -> None:
    still, motion = random_gaussians(3), random_motion([1.0, 3.0], [0, 2])
    halfway = motion.state_at(still, 2.0).means[[0, 2]]
    torch.testing.assert_close(halfway, still.means[[0, 2]] + motion.offsets.mean(0))
    assert_same(motion.state_at(still, -9.0), motion.state_at(still, 1.0))
    assert_same(motion.state_at(still, 9.0), motion.state_at(still, 3.0))


def test_cubic_motion_keeps_a_uniform_velocity() -> None:
    motion = random_motion([0.0, 1.0, 2.0, 4.0], [0], "cubic")
    line = motion.key_times_s[:, None, None] * torch.tensor([1.0, -2, 3], dtype=F64)
    motion = KeyframeMotion(
        **{f.name: getattr(motion, f.name) for f in fields(motion)} | {"offsets": line}
    )
    still = random_gaussians(1)
    torch.testing.assert_close(
        motion.state_at(still, 3.3).means - still.means,
        3.3 * torch.tensor([[1.0, -2, 3]], dtype=F64),
    )


def test_selecting_commutes_with_moving() -> None:
    still, motion = random_gaussians(6), random_motion([0.0, 1.0], [1, 3, 4])
    kept = torch.tensor([True, False, True, True, False, True])
    assert_same(
        motion.select(kept).state_at(still.select(kept), 0.4),
        motion.state_at(still, 0.4).select(kept),
    )


def test_one_key_and_no_moving_gaussians_are_legal() -> None:
    still = random_gaussians(2)
    one_key = random_motion([0.5], [0])
    torch.testing.assert_close(
        one_key.state_at(still, 7.0).means[0], still.means[0] + one_key.offsets[0, 0]
    )
    assert random_motion([0.0, 1.0], []).state_at(still, 0.5) is still
    assert StaticMotion().state_at(still, 3.0) is still


def test_motion_is_differentiable() -> None:
    still, motion = random_gaussians(3), random_motion([0.0, 1.0], [0, 2])

    def positions(
        offsets: torch.Tensor, rotations: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        moved = KeyframeMotion(
            key_times_s=motion.key_times_s,
            moving_index=motion.moving_index,
            offsets=offsets,
            rotations=rotations,
            log_scale_offsets=motion.log_scale_offsets,
        ).state_at(still, 0.3)
        return moved.means, moved.quats

    assert torch.autograd.gradcheck(
        positions, (motion.offsets.requires_grad_(), motion.rotations.requires_grad_())
    )


def test_both_motions_keep_the_protocol() -> None:
    assert isinstance(StaticMotion(), Motion)
    assert isinstance(random_motion([0.0], [0]), Motion)


def test_concatenation_and_empty_sets() -> None:
    parts = [random_gaussians(2), random_gaussians(0), random_gaussians(3)]
    whole = concatenate(parts)
    assert len(whole) == 5
    assert_same(whole.select(torch.tensor([2, 3, 4])), parts[2])
    with pytest.raises(ShapeError, match="one harmonic degree"):
        concatenate([random_gaussians(1), random_gaussians(1, 4)])


@pytest.mark.usefixtures("as_shipped")
def test_wrong_shapes_are_named() -> None:
    good = random_gaussians(2)
    parts = {f.name: getattr(good, f.name) for f in fields(good)}
    with pytest.raises(ShapeError, match=r"Gaussians.means: expected \(2, 3\)"):
        Gaussians(**parts | {"means": torch.zeros(3, 3)})
    with pytest.raises(ShapeError, match=r"Gaussians.sh"):
        Gaussians(**parts | {"sh": torch.zeros(2, 5, 3)})
    with pytest.raises(ShapeError, match="strictly increasing"):
        random_motion([1.0, 1.0], [0])
    with pytest.raises(ShapeError, match="indices that strictly increase"):
        random_motion([0.0, 1.0], [3, 1])
    with pytest.raises(ShapeError, match=r"KeyframeMotion\.offsets"):
        KeyframeMotion(
            key_times_s=torch.zeros(1),
            moving_index=torch.tensor([0]),
            offsets=torch.zeros(1, 2, 3),
            rotations=torch.zeros(1, 1, 4),
            log_scale_offsets=torch.zeros(1, 1, 3),
        )


def test_a_zero_quaternion_is_turned_by_the_motion() -> None:
    still = random_gaussians(1)
    still = Gaussians(
        **{f.name: getattr(still, f.name) for f in fields(still)}
        | {"quats": torch.zeros(1, 4).double()}
    )
    motion = random_motion([0.0], [0])
    torch.testing.assert_close(motion.state_at(still, 0.0).quats, motion.rotations[0])
