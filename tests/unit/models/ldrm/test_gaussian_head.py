import dataclasses
import math

import pytest
import torch

from diff4splat.errors import ShapeError
from diff4splat.geometry import quaternion, rigid
from diff4splat.geometry.camera import Camera, pinhole, project
from diff4splat.models.config.model import ActivationConfig
from diff4splat.models.ldrm.gaussian_head import PixelBase, activate
from diff4splat.scene.harmonics import color_from_dc

CONFIG = ActivationConfig(footprint_px=0.7)
FRAMES, HEIGHT, WIDTH = 3, 2, 4


def cameras(dtype: torch.dtype = torch.float64) -> Camera:
    """A path that turns and moves, with different focal lengths in x and y."""
    angles = torch.linspace(0, 1.2, FRAMES, dtype=dtype)
    turn = quaternion.from_axis_angle(
        torch.tensor([0.3, 1.0, -0.2], dtype=dtype).expand(FRAMES, 3), angles
    )
    poses = rigid.from_parts(quaternion.to_matrix(turn), torch.randn(FRAMES, 3, dtype=dtype))
    camera = pinhole(50.0, (HEIGHT, WIDTH), dtype).with_pose(poses)
    return dataclasses.replace(
        camera, focal_px=torch.tensor([40.0, 62.5], dtype=dtype).expand(FRAMES, 2)
    )


def base(dtype: torch.dtype = torch.float64) -> PixelBase:
    grid = (FRAMES, HEIGHT, WIDTH)
    return PixelBase(
        rgb=torch.rand(*grid, 3, dtype=dtype),
        distance=1 + torch.rand(grid, dtype=dtype),
        opacity=torch.rand(grid, dtype=dtype),
        cameras=cameras(dtype),
    )


def zeros(dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return torch.zeros(12, FRAMES, HEIGHT, WIDTH, dtype=dtype)


def cell(frame: int, row: int, column: int) -> int:
    return (frame * HEIGHT + row) * WIDTH + column


def test_zero_is_the_base_scene_in_frame_row_column_order() -> None:
    scene = base()
    gaussians = activate(zeros(), scene, CONFIG)
    for index in [(0, 0, 0), (1, 1, 2), (2, 0, 3)]:
        n, camera = cell(*index), scene.cameras[index[0]]
        pixel, depth = project(camera, gaussians.means[n : n + 1])
        torch.testing.assert_close(pixel[0], pixel.new_tensor([index[2] + 0.5, index[1] + 0.5]))
        length = (gaussians.means[n] - camera.position).norm()
        torch.testing.assert_close(length, scene.distance[index])
        torch.testing.assert_close(color_from_dc(gaussians.sh[n, 0]), scene.rgb[index])
        assert float(gaussians.opacities[n]) == float(scene.opacity[index])
        want = 0.7 * float(depth) / math.sqrt(40.0 * 62.5)
        torch.testing.assert_close(gaussians.scales[n], torch.full((3,), want, dtype=torch.float64))
        turn = quaternion.to_matrix(gaussians.quats[n : n + 1])[0]
        torch.testing.assert_close(turn, camera.world_from_camera[:3, :3])


def test_every_channel_group_does_what_it_says() -> None:
    scene, raw = base(), torch.randn(12, FRAMES, HEIGHT, WIDTH, dtype=torch.float64)
    gaussians = activate(raw, scene, CONFIG)
    index = (1, 0, 2)
    n, (rgb, scale, turn, opacity, distance) = cell(*index), raw[:, *index].split((3, 3, 4, 1, 1))
    limit = math.log(16)
    far = float(scene.distance[index]) * math.exp(limit * math.tanh(float(distance) / limit))
    camera = scene.cameras[index[0]]
    length = (gaussians.means[n] - camera.position).norm()
    assert float(length) == pytest.approx(far)
    factor = (limit * torch.tanh(scale / limit)).exp()
    depth = project(camera, gaussians.means[n : n + 1])[1]
    torch.testing.assert_close(gaussians.scales[n], 0.7 * depth / math.sqrt(40.0 * 62.5) * factor)
    torch.testing.assert_close(
        color_from_dc(gaussians.sh[n, 0]), scene.rgb[index] + torch.tanh(rgb)
    )
    own = turn + torch.tensor([1.0, 0, 0, 0], dtype=torch.float64)
    want = camera.world_from_camera[:3, :3] @ quaternion.to_matrix((own / own.norm())[None])[0]
    torch.testing.assert_close(quaternion.to_matrix(gaussians.quats[n : n + 1])[0], want)
    odds = (
        float(scene.opacity[index]) / (1 - float(scene.opacity[index])) * math.exp(float(opacity))
    )
    assert float(gaussians.opacities[n]) == pytest.approx(odds / (1 + odds))


def test_turning_the_world_turns_the_gaussians() -> None:
    scene, raw = base(), torch.randn(12, FRAMES, HEIGHT, WIDTH, dtype=torch.float64)
    turn = quaternion.normalize(torch.randn(1, 4, dtype=torch.float64))
    world = rigid.from_parts(quaternion.to_matrix(turn), torch.randn(1, 3, dtype=torch.float64))
    moved = dataclasses.replace(
        scene, cameras=scene.cameras.with_pose(world @ scene.cameras.world_from_camera)
    )
    before, after = activate(raw, scene, CONFIG), activate(raw, moved, CONFIG)
    torch.testing.assert_close(after.means, rigid.transform_points(world[0], before.means))
    torch.testing.assert_close(after.scales, before.scales)
    want = quaternion.to_matrix(turn) @ quaternion.to_matrix(before.quats)
    torch.testing.assert_close(quaternion.to_matrix(after.quats), want)


@pytest.mark.parametrize("value", [-1e4, -1e3, 1e3, 1e4])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_extreme_maps_have_finite_values_and_gradients(value: float, dtype: torch.dtype) -> None:
    raw = (zeros(dtype) + value).requires_grad_()
    gaussians = activate(raw, base(dtype), CONFIG)
    outputs = [getattr(gaussians, field.name) for field in dataclasses.fields(gaussians)]
    sum(out.sum() for out in outputs).backward()
    assert all(torch.isfinite(out).all() for out in outputs) and torch.isfinite(raw.grad).all()
    assert (gaussians.scales > 0).all()


def test_gradcheck() -> None:
    scene = base()

    def outputs(raw: torch.Tensor) -> tuple[torch.Tensor, ...]:
        gaussians = activate(raw, scene, CONFIG)
        return tuple(getattr(gaussians, field.name) for field in dataclasses.fields(gaussians))

    raw = torch.randn(12, FRAMES, HEIGHT, WIDTH, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(outputs, raw)


@pytest.mark.parametrize("part", ["raw", "base"])
def test_half_precision_is_refused(part: str) -> None:
    raw, scene = zeros(), base()
    if part == "raw":
        raw = raw.half()
    else:
        scene = dataclasses.replace(scene, distance=scene.distance.bfloat16())
    with pytest.raises(ShapeError, match="expected float32 or float64"):
        activate(raw, scene, CONFIG)


def test_maps_of_another_grid_are_refused() -> None:
    with pytest.raises(
        ShapeError,
        match=r"raw maps: expected \(12, 3, 2, 4\) \(from the base\), got \(12, 3, 4, 2\)",
    ):
        activate(zeros().transpose(2, 3), base(), CONFIG)


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rgb": torch.zeros(FRAMES, HEIGHT, WIDTH)}, "PixelBase.rgb: expected"),
        ({"opacity": torch.zeros(FRAMES, WIDTH, HEIGHT)}, "PixelBase.opacity: expected"),
        ({"cameras": cameras()[:2]}, r"PixelBase.cameras: expected .*\(3, 2, 4\), got \(2, 2, 4\)"),
        ({"cameras": cameras().resized((4, 8))}, "PixelBase.cameras: expected"),
    ],
)
def test_base_parts_must_fit(change: dict, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        dataclasses.replace(base(), **change)
