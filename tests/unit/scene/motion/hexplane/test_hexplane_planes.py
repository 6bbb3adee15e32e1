"""Feature planes: values, gradients, borders, times and shapes."""

import itertools
from dataclasses import replace

import oracles_hexplane as oracles
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles_hexplane import BOX, F64, random_planes, random_points, with_levels
from torch import Tensor

from diff4splat.errors import ConfigError, InputError, ShapeError
from diff4splat.scene.motion.hexplane.planes import HexPlanes, HexPlaneSize, make_planes
from diff4splat.scene.motion.hexplane.regularisers import penalties, roughness

TIMES = (1.0, 1.37, 2.2, 3.0)


def leaves(planes: HexPlanes, points: Tensor) -> tuple[HexPlanes, Tensor, list[Tensor]]:
    """The same with gradients."""
    levels = [[p.clone().requires_grad_() for p in level] for level in planes.levels]
    points = points.clone().requires_grad_()
    return with_levels(planes, levels), points, [points, *itertools.chain(*levels)]


@pytest.mark.parametrize("time_mapping", ["full", "half"])
@pytest.mark.parametrize("flipped", [False, True])
def test_features_and_gradients_are_those_of_dense_weights(
    time_mapping: str, flipped: bool
) -> None:
    box = BOX.flip(0) if flipped else BOX
    planes = random_planes(time_mapping=time_mapping, box=box)
    planes, points, inputs = leaves(planes, random_points(40))
    for time_s in TIMES:
        got, want = planes.features(points, time_s), oracles.features(planes, points, time_s)
        torch.testing.assert_close(got, want, rtol=1e-10, atol=1e-10)
        seed = torch.randn_like(want)
        pairs = zip(
            torch.autograd.grad(got, inputs, seed),
            torch.autograd.grad(want, inputs, seed),
            strict=True,
        )
        for ours, theirs in pairs:
            torch.testing.assert_close(ours, theirs, rtol=1e-10, atol=1e-10)


def test_gradcheck() -> None:
    size = HexPlaneSize(space=(2, 3, 2), time=3, channels=1, multipliers=(1,))
    planes, _, inputs = leaves(random_planes(size), random_points(4))

    def made(points: Tensor, *level: Tensor) -> Tensor:
        return with_levels(planes, [level]).features_at_times(points, (1.3, 2.9))

    assert torch.autograd.gradcheck(made, inputs)


def test_planes_of_one_give_features_of_one() -> None:
    planes = random_planes()
    ones = with_levels(planes, [[torch.ones_like(p) for p in level] for level in planes.levels])
    got = ones.features(random_points(9), 1.7)
    assert got.shape == (9, 32)
    torch.testing.assert_close(got, torch.ones_like(got))


def test_linear_ramps_give_the_product_of_ramps() -> None:
    box = torch.tensor([[0.0, 0, 0], [1, 2, 3]], dtype=F64)
    size = HexPlaneSize(space=(5, 4, 3), time=6, channels=1, multipliers=(1,))
    planes = make_planes(size, box, (0.0, 2.0)).to(F64)
    ends = (1.0, 2.0, 3.0, 2.0)

    def ramp(column: int, row: int, shape: torch.Size) -> Tensor:
        across = torch.linspace(0, ends[column], shape[1], dtype=F64)
        along = torch.linspace(0, ends[row], shape[0], dtype=F64)
        return (1 + across[None, :] + 10 * along[:, None])[..., None]

    pairs = list(itertools.combinations(range(4), 2))
    shapes = [plane.shape for plane in planes.levels[0]]
    ramps = [ramp(*pair, shape) for pair, shape in zip(pairs, shapes, strict=True)]
    points, time_s = torch.rand(20, 3, dtype=F64) * box[1], 1.234
    place = torch.cat([points, torch.full((20, 1), time_s, dtype=F64)], 1)
    want = torch.ones(20, dtype=F64)
    for i, j in pairs:
        want = want * (1 + place[:, i] + 10 * place[:, j])
    torch.testing.assert_close(with_levels(planes, [ramps]).features(points, time_s)[:, 0], want)


def test_outside_the_box_the_border_is_read_and_the_point_does_not_matter() -> None:
    planes, points, inputs = leaves(random_planes(), random_points(30) * 3)
    inside = points.detach().clamp(BOX[0].double(), BOX[1].double())
    got = planes.features(points, 2.0)
    torch.testing.assert_close(got, planes.features(inside, 2.0))
    slope = torch.autograd.grad(got.sum(), inputs[0])[0]
    outside = (points < BOX[0]) | (points > BOX[1])
    assert bool(outside.any()) and bool((slope[outside] == 0).all())


def test_times_outside_the_range_count_as_its_ends() -> None:
    planes, points = random_planes(), random_points(5)
    for beyond, end in ((-7.0, 1.0), (1e300, 3.0), (float("inf"), 3.0)):
        assert torch.equal(planes.features(points, beyond), planes.features(points, end))


def test_a_range_of_one_moment_is_its_first_node() -> None:
    planes, points = random_planes(), random_points(5)
    moment = replace(planes, time_range_s=(1.0, 1.0))
    assert torch.equal(moment.features(points, 5.0), planes.features(points, 1.0))


def test_half_reads_the_upper_half_of_the_time_nodes_only() -> None:
    planes, points, _ = leaves(random_planes(time_mapping="half"), random_points(8))
    planes.features_at_times(points, TIMES).sum().backward()
    for level in planes.levels:
        for k in (2, 4, 5):  # of nodes 0 … 5 the first two lie before 2.5
            assert bool((level[k].grad[:2] == 0).all()) and bool((level[k].grad[2:] != 0).any())


def test_several_times_at_once_are_each_of_them() -> None:
    planes, points = random_planes(), random_points(7)
    together = planes.features_at_times(points, TIMES)
    alone = torch.stack([planes.features(points, time_s) for time_s in TIMES])
    torch.testing.assert_close(together, alone, rtol=1e-14, atol=1e-14)
    assert planes.features_at_times(points, ()).shape == (0, 7, 32)


def test_at_the_start_nothing_depends_on_time() -> None:
    planes = make_planes(HexPlaneSize(), BOX, (0.0, 1.0), torch.Generator().manual_seed(1))
    points = random_points(50, torch.float32)
    assert torch.equal(planes.features(points, 0.1), planes.features(points, 0.83))
    spatial = torch.cat([level[k].flatten() for level in planes.levels for k in (0, 1, 3)])
    assert 0.1 <= float(spatial.min()) < 0.11 and 0.49 < float(spatial.max()) <= 0.5
    assert [tuple(plane.shape) for plane in planes.levels[1]] == [
        (128, 128, 16), (128, 128, 16), (25, 128, 16), (128, 128, 16), (25, 128, 16), (25, 128, 16)
    ]  # fmt: skip


def test_equal_generators_draw_equal_planes() -> None:
    drawn = [
        make_planes(HexPlaneSize(), BOX, (0.0, 1.0), torch.Generator().manual_seed(4)).levels
        for _ in range(2)
    ]
    assert all(torch.equal(a, b) for a, b in zip(drawn[0][1], drawn[1][1], strict=True))


@settings(max_examples=25, deadline=None)
@given(
    nodes=st.tuples(*[st.integers(1, 4)] * 4),
    channels=st.sampled_from([1, 3, 16]),
    count=st.integers(0, 6),
    time_s=st.floats(-1, 5),
)
def test_every_size_agrees_with_dense_weights(
    nodes: tuple[int, int, int, int], channels: int, count: int, time_s: float
) -> None:
    size = HexPlaneSize(space=nodes[:3], time=nodes[3], channels=channels, multipliers=(1, 3))
    planes, points = random_planes(size), random_points(count)
    want = oracles.features(planes, points, time_s)
    torch.testing.assert_close(planes.features(points, time_s), want, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("dtype", [torch.float32, F64])
def test_extreme_points_and_flat_boxes_stay_finite(dtype: torch.dtype) -> None:
    flat = BOX.clone()
    flat[1, 2] = flat[0, 2]
    for box in (BOX, flat, torch.zeros(2, 3), BOX * 1e30):
        planes, points, inputs = leaves(
            random_planes(dtype=dtype, box=box.to(dtype)),
            torch.tensor([[0.0, 0, 0], [1e30, -1e30, 1e-30], [torch.inf] * 3, [-torch.inf] * 3]).to(
                dtype
            ),
        )
        made = planes.features(points, 2.0)
        gradients = torch.autograd.grad(made.sum(), inputs)
        assert all(bool(torch.isfinite(value).all()) for value in (made, *gradients))


@pytest.mark.parametrize("dtype", [torch.float32, F64])
def test_a_point_that_is_no_number_spoils_itself_alone(dtype: torch.dtype) -> None:
    planes, points = random_planes(dtype=dtype), random_points(6, dtype)
    spoilt = points.clone()
    spoilt[2, 1] = torch.nan
    got, want = planes.features(spoilt, 2.0), planes.features(points, 2.0)
    assert bool(got[2].isnan().all())
    kept = torch.arange(6) != 2
    assert torch.equal(got[kept], want[kept])


def test_penalties_are_zero_on_ramps_and_at_the_start() -> None:
    planes = make_planes(HexPlaneSize(space=(4, 5, 6), time=7), BOX, (0.0, 1.0)).to(F64)
    start = penalties(planes, "both")
    assert float(start.time) == float(start.static) == 0 < float(start.space)
    ramps = torch.linspace(-1, 3, 9, dtype=F64)[:, None, None] + torch.rand(1, 4, 2, dtype=F64)
    assert float(roughness(ramps)) == pytest.approx(0, abs=1e-28)
    assert float(roughness(ramps, "both")) > 0.01


def test_penalties_are_the_sums_of_their_definition() -> None:
    planes = random_planes(HexPlaneSize(space=(5, 4, 3), time=6, channels=2))

    def rough(plane: Tensor) -> float:
        rows = [plane[k + 2] - 2 * plane[k + 1] + plane[k] for k in range(plane.shape[0] - 2)]
        return float(torch.stack(rows).square().mean())

    level = list(itertools.chain(*planes.levels))
    spatial = [p for k, p in enumerate(level) if k % 6 in (0, 1, 3)]
    temporal = [p for k, p in enumerate(level) if k % 6 in (2, 4, 5)]
    got = penalties(planes)
    assert float(got.space) == pytest.approx(sum(map(rough, spatial)))
    assert float(got.time) == pytest.approx(sum(map(rough, temporal)))
    far = [float((1 - plane).abs().mean()) for plane in temporal]
    assert float(got.static) == pytest.approx(sum(far))
    columns = sum(rough(plane.transpose(0, 1)) for plane in temporal)
    assert float(penalties(planes, "both").time) == pytest.approx(float(got.time) + columns)


def test_planes_of_two_nodes_have_no_roughness() -> None:
    plane = torch.rand(2, 2, 3, requires_grad=True)
    roughness(plane, "both").backward()
    assert bool((plane.grad == 0).all())


@pytest.mark.parametrize(
    "changes", [{"time": 0}, {"channels": 0}, {"multipliers": ()}, {"space": (4, 4, -1)}]
)
def test_sizes_below_one_are_refused(changes: dict) -> None:
    with pytest.raises(ConfigError, match="HexPlaneSize"):
        HexPlaneSize(**changes)


def test_wrong_shapes_and_times_are_refused(as_shipped: None) -> None:
    planes = random_planes()
    with pytest.raises(InputError, match="first ≤ last"):
        replace(planes, time_range_s=(3.0, 1.0))
    with pytest.raises(ShapeError, match="bounds"):
        replace(planes, bounds=torch.zeros(3, 2))
    level = list(planes.levels[0])
    for broken in (level[:5], [*level[:5], level[5][:-1, :-1]], [*level[:5], level[5][..., :-1]]):
        with pytest.raises(ShapeError, match="levels"):
            with_levels(planes, [broken])
    narrow = [plane[..., :2] for plane in level]
    for levels in ((), ((),), (level, narrow)):
        with pytest.raises(ShapeError, match="levels"):
            with_levels(planes, levels)
