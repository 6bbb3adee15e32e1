"""HexPlane motion: states, gradients, identity at the start, selection, named tensors."""

from dataclasses import fields, replace

import numpy as np
import oracles_hexplane as oracles
import pytest
import torch
from oracles_hexplane import F64, random_cloud, random_motion, random_planes
from torch import Tensor

from diff4splat.errors import ConfigError, ShapeError
from diff4splat.geometry import quaternion
from diff4splat.scene.gaussians import Gaussians
from diff4splat.scene.motion.hexplane import residuals
from diff4splat.scene.motion.hexplane.decoder import (
    HEAD_NAMES,
    DecoderSize,
    Layer,
    MotionDecoder,
    make_decoder,
)
from diff4splat.scene.motion.hexplane.motion import HexPlaneMotion
from diff4splat.scene.motion.protocol import Motion

PARTS = [field.name for field in fields(Gaussians)]


@pytest.mark.parametrize("rotation", ["product", "additive"])
@pytest.mark.parametrize("heads", [HEAD_NAMES, ("position",), ("scale", "opacity"), ()])
def test_states_are_those_of_logarithms_and_logits(rotation: str, heads: tuple) -> None:
    motion, still = random_motion([0, 2, 3], heads, rotation=rotation), random_cloud(5)
    for time_s in (0.0, 1.4, 3.0):
        got, want = motion.state_at(still, time_s), oracles.state(motion, still, time_s)
        for name in PARTS:
            torch.testing.assert_close(
                getattr(got, name), torch.from_numpy(want[name]), rtol=1e-10, atol=1e-10
            )


def test_those_that_stand_still_are_passed_through() -> None:
    motion, still = random_motion([1, 4]), random_cloud(6)
    state, kept = motion.state_at(still, 2.0), [0, 2, 3, 5]
    for name in PARTS:
        assert torch.equal(getattr(state, name)[kept], getattr(still, name)[kept])
        assert not torch.equal(getattr(state, name)[[1, 4]], getattr(still, name)[[1, 4]])


@pytest.mark.parametrize("dtype", [torch.float32, F64])
def test_heads_of_zero_are_the_identity(dtype: torch.dtype) -> None:
    planes, still = random_planes(dtype=dtype), random_cloud(9, dtype=dtype)
    size = DecoderSize(heads=HEAD_NAMES, coefficients=4)
    decoder = make_decoder(planes.feature_count, size).to(dtype)
    for rotation in ("product", "additive"):
        motion = HexPlaneMotion(
            planes=planes, decoder=decoder, moving_index=torch.arange(9), rotation=rotation
        )
        state = motion.state_at(still, 1.8)
        for name in ("means", "scales", "sh"):
            assert torch.equal(getattr(state, name), getattr(still, name))
        torch.testing.assert_close(state.quats, quaternion.normalize(still.quats))
        torch.testing.assert_close(state.opacities, still.opacities)


def test_a_zero_quaternion_means_no_rotation() -> None:
    delta = torch.tensor([[0.1, 0.2, -0.3, 0.4]], dtype=F64)
    none, unit = torch.zeros(1, 4, dtype=F64), torch.tensor([[1.0, 0, 0, 0]], dtype=F64)
    for rule in (residuals.turned, residuals.added):
        torch.testing.assert_close(rule(none, delta), rule(unit, delta))


def test_gradcheck_of_everything_that_can_be_learned() -> None:
    motion, still = random_motion([0, 2], depth=1), random_cloud(3)
    learned = {k: v.detach().clone().requires_grad_() for k, v in motion.tensors().items()}
    names = [n for n in learned if n.startswith(("planes.1", "trunk", "rotation", "opacity"))]
    parts = [getattr(still, name).clone().requires_grad_() for name in PARTS]

    def made(*values: Tensor) -> tuple[Tensor, ...]:
        some = dict(zip(names, values, strict=False))
        cloud = Gaussians(**dict(zip(PARTS, values[len(names) :], strict=True)))
        state = motion.with_tensors({**learned, **some}).state_at(cloud, 1.7)
        return tuple(getattr(state, name) for name in PARTS)

    inputs = (*(learned[name] for name in names), *parts)
    assert torch.autograd.gradcheck(made, inputs, fast_mode=True)


def test_gradients_reach_every_tensor_in_float32() -> None:
    motion = random_motion([0, 1, 2], dtype=torch.float32)
    learned = {k: v.clone().requires_grad_() for k, v in motion.tensors().items()}
    state = motion.with_tensors(learned).state_at(random_cloud(3, dtype=torch.float32), 1.7)
    sum(getattr(state, name).square().sum() for name in PARTS).backward()
    for name, tensor in learned.items():
        assert tensor.grad is not None and bool(torch.isfinite(tensor.grad).all()), name
        assert float(tensor.grad.abs().sum()) > 0 or "bias" in name, name


@pytest.mark.parametrize("dtype", [torch.float32, F64])
@pytest.mark.parametrize("size", [0.0, 1e-30, 1e30, -1e30])
def test_extreme_residuals_stay_finite(dtype: torch.dtype, size: float) -> None:
    opacities = torch.tensor([0.0, 1.0, 0.5, 1e-38, 1 - 1e-7], dtype=dtype).requires_grad_()
    quats = torch.tensor([[0.0] * 4, [1e-30] * 4, [1e30] * 4, [1.0] * 4, [-1.0, 0, 0, 0]])
    cloud = replace(
        random_cloud(5, dtype=dtype),
        opacities=opacities,
        quats=quats.to(dtype).requires_grad_(),
        scales=torch.tensor([0.0, 1e-20, 1.0, 1e20, 1.0], dtype=dtype)[:, None].expand(5, 3),
    )
    deltas = {
        "scale": torch.full((5, 3), size, dtype=dtype, requires_grad=True),
        "opacity": torch.full((5, 1), size, dtype=dtype, requires_grad=True),
        "rotation": torch.full((5, 4), size, dtype=dtype, requires_grad=True),
    }
    for rotation in ("product", "additive"):
        state = residuals.apply(cloud, deltas, rotation)
        values = [state.scales.log1p(), state.opacities, state.quats]
        inputs = [*deltas.values(), opacities, cloud.quats]
        gradients = torch.autograd.grad(sum(value.sum() for value in values), inputs)
        assert all(bool(torch.isfinite(value).all()) for value in (*values, *gradients))
        assert float(state.opacities.detach()[0]) == 0 and float(state.opacities.detach()[1]) == 1


@pytest.mark.parametrize("opacity", [1e-6, 0.1, 0.5, 0.999])
def test_opacity_moves_as_its_logit(opacity: float) -> None:
    before = torch.tensor([opacity] * 3, dtype=F64)
    delta = torch.tensor([-3.0, 0.0, 2.5], dtype=F64, requires_grad=True)
    after = residuals.shifted(before, delta)
    torch.testing.assert_close(after, torch.sigmoid(torch.logit(before) + delta))
    (slope,) = torch.autograd.grad(after.sum(), delta)
    torch.testing.assert_close(slope, (after * (1 - after)).detach())


def test_time_is_clamped_to_the_range() -> None:
    motion, still = random_motion([0, 1]), random_cloud(2)
    assert motion.time_range_s == (1.0, 3.0)
    for beyond, end in ((-1.0, 1.0), (99.0, 3.0)):
        got, want = motion.state_at(still, beyond), motion.state_at(still, end)
        assert all(torch.equal(getattr(got, name), getattr(want, name)) for name in PARTS)


def test_several_times_at_once_are_each_of_them() -> None:
    motion, still, times = random_motion([0, 3]), random_cloud(4), (1.0, 1.5, 2.9)
    for time_s, state in zip(times, motion.states_at(still, times), strict=True):
        alone = motion.state_at(still, time_s)
        for name in PARTS:
            torch.testing.assert_close(getattr(state, name), getattr(alone, name))
    assert motion.states_at(still, ()) == []


def test_selecting_commutes_with_moving() -> None:
    motion, still = random_motion([0, 2, 5]), random_cloud(7)
    kept = torch.tensor([True, False, False, True, True, True, False])
    got = motion.select(kept).state_at(still.select(kept), 1.3)
    want = motion.state_at(still, 1.3).select(kept)
    for name in PARTS:
        torch.testing.assert_close(getattr(got, name), getattr(want, name))
    assert motion.select(kept).moving_index.tolist() == [0, 3]


def test_without_moving_gaussians_the_state_is_the_canonical_one() -> None:
    motion, still = random_motion([]), random_cloud(3)
    assert motion.state_at(still, 2.0) is still
    gone = random_motion([0, 1]).select(torch.zeros(2, dtype=torch.bool))
    empty = still.select(torch.zeros(3, dtype=torch.bool))
    assert len(gone.state_at(empty, 2.0)) == 0


def test_casting_keeps_the_index_and_the_state() -> None:
    motion, still = random_motion([0, 1]), random_cloud(2)
    single = motion.to(torch.float32)
    assert single.moving_index.dtype == torch.long
    assert {tensor.dtype for tensor in single.tensors().values()} == {torch.float32}
    assert single.planes.bounds.dtype == torch.float32
    state = single.state_at(still.to(torch.float32), 1.9)
    for name in PARTS:
        want = getattr(motion.state_at(still, 1.9), name)
        torch.testing.assert_close(getattr(state, name).double(), want, rtol=1e-4, atol=1e-4)
    assert motion.to(torch.device("cpu")).state_at(still, 1.0).means.dtype == F64


def test_tensors_go_out_and_in_by_name() -> None:
    motion = random_motion([0], ("position", "color"))
    named = motion.tensors()
    assert list(named)[:2] == ["planes.0.xy", "planes.0.xz"]
    assert {name.split(".")[0] for name in named} == {"planes", "trunk", "position", "color"}
    assert named["color.1.weight"].shape == (12, 8)
    doubled = motion.with_tensors({name: 2 * tensor for name, tensor in named.items()})
    assert all(torch.equal(doubled.tensors()[name], 2 * named[name]) for name in named)
    for wrong in ({**named, "planes.9.xy": named["planes.0.xy"]}, dict(list(named.items())[1:])):
        with pytest.raises(ShapeError, match="equal names"):
            motion.with_tensors(wrong)


def test_it_is_a_motion() -> None:
    assert isinstance(random_motion([0]), Motion)


def test_weights_are_drawn_as_promised() -> None:
    size = DecoderSize(width=32, depth=3, heads=("scale", "position"))
    made = make_decoder(16, size, torch.Generator().manual_seed(3))
    again = make_decoder(16, size, torch.Generator().manual_seed(3))
    assert [tuple(layer.weight.shape) for layer in made.trunk] == [(32, 16), (32, 32), (32, 32)]
    assert list(made.heads) == ["position", "scale"]
    for name, (hidden, last) in made.heads.items():
        assert torch.equal(hidden.weight, again.heads[name][0].weight)
        assert not bool(last.weight.any()) and not bool(last.bias.any())
        edge = (6 / 64) ** 0.5
        assert 0.9 * edge < float(hidden.weight.abs().max()) <= edge
    moved = make_decoder(16, size, zero_heads=False)
    assert all(bool(last.weight.any()) for _, last in moved.heads.values())


def test_depth_one_is_one_layer_and_each_head_is_two() -> None:
    decoder = make_decoder(4, DecoderSize(width=3, heads=("position",)), zero_heads=False).to(F64)
    told = decoder.residuals(torch.ones(1, 4, dtype=F64))["position"]
    relu = torch.nn.functional.relu
    trunk, (hidden, last) = decoder.trunk[0], decoder.heads["position"]
    values = trunk.weight.sum(1) + trunk.bias
    values = hidden.weight @ relu(values) + hidden.bias
    torch.testing.assert_close(told[0], last.weight @ relu(values) + last.bias)


def test_what_does_not_fit_is_refused(as_shipped: None) -> None:
    motion = random_motion([0, 1])
    with pytest.raises(ShapeError, match="increase"):
        replace(motion, moving_index=torch.tensor([1, 0]))
    with pytest.raises(ShapeError, match="decoder of 32"):
        replace(motion, decoder=make_decoder(7, DecoderSize()))
    with pytest.raises(ShapeError, match="colour head"):
        motion.state_at(random_cloud(2, coefficients=1), 2.0)
    with pytest.raises(ConfigError, match="heads"):
        DecoderSize(heads=("position", "weight"))
    with pytest.raises(ConfigError, match="above 0"):
        DecoderSize(depth=0)
    with pytest.raises(ShapeError, match="chain"):
        MotionDecoder(trunk=())
    with pytest.raises(ShapeError, match="bias"):
        Layer(weight=torch.zeros(2, 3), bias=torch.zeros(3))
    hidden, last = motion.decoder.heads["scale"]
    for heads in (
        {"weight": (hidden, last)},
        {"rotation": (hidden, last)},
        {"scale": (last, last)},
    ):
        with pytest.raises(ShapeError, match="heads"):
            MotionDecoder(trunk=motion.decoder.trunk, heads=heads)


def test_the_product_turns_the_canonical_rotation_from_the_right() -> None:
    quat, delta = np.array([0.5, 0.5, -0.5, 0.5]), np.array([0.2, 0.4, 0.1, -0.6])
    got = residuals.turned(torch.from_numpy(quat)[None], torch.from_numpy(delta)[None])[0]
    one = delta + np.array([1.0, 0, 0, 0])
    turn = one / np.linalg.norm(one)
    want = quaternion.multiply(torch.from_numpy(quat)[None], torch.from_numpy(turn)[None])[0]
    torch.testing.assert_close(got, want)
    matrices = quaternion.to_matrix(torch.from_numpy(np.stack([quat, turn])))
    torch.testing.assert_close(quaternion.to_matrix(got), matrices[0] @ matrices[1])
