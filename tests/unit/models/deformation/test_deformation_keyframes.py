import dataclasses
import math

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion
from diff4splat.models.config.model import ActivationConfig
from diff4splat.models.deformation.keyframes import (
    DeformationUnits,
    deformation_state,
    keyframe_motion,
    raw_scales,
)
from diff4splat.scene.gaussians import Gaussians

UNITS = DeformationUnits(length_unit=4.0, activation=ActivationConfig())
GRID = (2, 2, 3)
CELLS = torch.tensor([1, 4, 11])


def gaussians(count: int) -> Gaussians:
    return Gaussians(
        means=torch.randn(count, 3).double(),
        quats=quaternion.normalize(torch.randn(count, 4).double()),
        scales=torch.rand(count, 3).double() + 0.1,
        opacities=torch.rand(count).double(),
        sh=torch.rand(count, 1, 3).double(),
    )


def test_raw_scales_are_channels_3_to_5_in_cell_order() -> None:
    maps = torch.randn(12, *GRID)
    assert torch.equal(raw_scales(maps)[7], maps[3:6, 1, 0, 1])


def test_zero_is_the_identity() -> None:
    state = deformation_state(torch.zeros(10, *GRID), torch.randn(3, 3), CELLS, UNITS)
    assert not state.offsets.any() and not state.log_scale_offsets.any()
    assert torch.equal(state.rotations, torch.tensor([[1.0, 0, 0, 0]]).expand(3, 4))


def test_every_channel_group_does_what_it_says() -> None:
    raw, scale = torch.randn(10, *GRID).double(), torch.randn(3, 3).double()
    state = deformation_state(raw, scale, CELLS, UNITS)
    own = raw[:, 1, 1, 2]  # cell 11
    torch.testing.assert_close(state.offsets[2], 4.0 * own[:3])
    turn = own[3:7] + torch.tensor([1.0, 0, 0, 0]).double()
    torch.testing.assert_close(state.rotations[2], turn / turn.norm())
    limit = math.log(16)
    want = limit * (torch.tanh((scale[2] + own[7:]) / limit) - torch.tanh(scale[2] / limit))
    torch.testing.assert_close(state.log_scale_offsets[2], want)


def test_motion_applies_the_papers_deformation() -> None:
    raws, scale = torch.randn(2, 10, *GRID).double(), torch.randn(3, 3).double()
    states = [deformation_state(raw, scale, CELLS, UNITS) for raw in raws]
    everything = torch.arange(3)
    motion = keyframe_motion(states, torch.tensor([0.0, 1.0]).double(), everything)
    still = gaussians(3)
    moved = motion.state_at(still, 1.0)
    torch.testing.assert_close(moved.means, still.means + states[1].offsets)
    turn = quaternion.multiply(still.quats, states[1].rotations)
    torch.testing.assert_close(quaternion.to_matrix(moved.quats), quaternion.to_matrix(turn))
    torch.testing.assert_close(moved.scales, still.scales * states[1].log_scale_offsets.exp())


@pytest.mark.parametrize("value", [-1e4, -1e3, -1.0, 1e3, 1e4])
def test_extremes_are_finite(value: float) -> None:
    raw = torch.full((10, *GRID), value, requires_grad=True)
    state = deformation_state(raw, torch.full((3, 3), -value), CELLS, UNITS)
    outputs = [getattr(state, field.name) for field in dataclasses.fields(state)]
    sum(out.sum() for out in outputs).backward()
    assert all(torch.isfinite(out).all() for out in outputs) and torch.isfinite(raw.grad).all()


def test_nothing_selected() -> None:
    none = torch.zeros(0, dtype=torch.long)
    state = deformation_state(torch.randn(10, *GRID), torch.zeros(0, 3), none, UNITS)
    motion = keyframe_motion([state], torch.tensor([0.0]), none)
    assert motion.offsets.shape == (1, 0, 3)
    still = gaussians(2)
    assert motion.state_at(still, 0.0) is still


def test_gradcheck() -> None:
    scale = torch.randn(3, 3, dtype=torch.float64, requires_grad=True)
    raw = torch.randn(10, *GRID, dtype=torch.float64, requires_grad=True)

    def outputs(raw: torch.Tensor, scale: torch.Tensor) -> tuple[torch.Tensor, ...]:
        state = deformation_state(raw, scale, CELLS, UNITS)
        return state.offsets, state.rotations, state.log_scale_offsets

    assert torch.autograd.gradcheck(outputs, (raw, scale))


def test_half_precision_is_refused() -> None:
    with pytest.raises(ShapeError, match="expected float32 or float64"):
        deformation_state(torch.zeros(10, *GRID).half(), torch.zeros(3, 3), CELLS, UNITS)


@pytest.mark.usefixtures("as_shipped")
def test_selections_must_agree() -> None:
    with pytest.raises(
        ShapeError, match=r"raw scales: expected \(3, 3\) as selected, got \(12, 3\)"
    ):
        deformation_state(torch.zeros(10, *GRID), torch.zeros(12, 3), CELLS, UNITS)
