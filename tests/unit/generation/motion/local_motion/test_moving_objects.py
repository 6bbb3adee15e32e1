"""Objects that move about themselves: found in maps, and followed by Gaussians."""

import math
from dataclasses import replace

import pytest
import torch
from image_layers import layer, layered, sliding_path
from torch import Tensor

from diff4splat.generation.layered_image.gaussians import GaussianSet, image_gaussians
from diff4splat.generation.motion.local_motion.find_objects import (
    LEAST_SIDE_PX,
    MovingMaps,
    with_moving_objects,
)
from diff4splat.generation.motion.local_motion.gaussians import with_local_motion
from diff4splat.generation.motion.local_motion.moving_object import MovingObjects
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import project
from diff4splat.render.api import render
from diff4splat.scene.scene import Provenance, Scene

SIDE, DEPTH, FIRST, LAST = 48, 6.0, 10, 38
KEY_TIMES_S = torch.linspace(0, 2, 17)
CAMERA = layer(torch.ones(SIDE, SIDE)).camera


def request(motion: str, *, seed: int = 0) -> MotionRequest:
    return MotionRequest(
        text=None,
        seed=seed,
        settings=GenerationSettings(),
        local_motion=motion,
        key_times_s=tuple(KEY_TIMES_S.tolist()),
    )


def maps(*, travel: float = 0.0, image_scale: float = 1.0) -> MovingMaps:
    """Of a square at one depth, that travels to the right."""
    event = torch.zeros(SIDE, SIDE, dtype=torch.long)
    event[FIRST:LAST, FIRST:LAST] = 1
    x = torch.linspace(0, travel, 3)[:, None, None] * (event > 0)
    return MovingMaps(
        camera=CAMERA,
        depth=torch.full((SIDE, SIDE), DEPTH),
        event=event,
        displacement=torch.stack([x, 0 * x, 0 * x], -1),
        image_scale=image_scale,
    )


def followed(
    motion: str, given: MovingMaps | None = None, rgb: Tensor | None = None
) -> tuple[GaussianSet, int]:
    """Gaussians of an image in which the square, white by default, moves so."""
    moved, objects = with_moving_objects(given or maps(), [request(motion)], round_bodies=True)
    changes = {"displacement": moved.displacement, "in_image": True, "opacity": 0.999}
    white = moved.event[..., None].expand(-1, -1, 3).float()
    pixels = layer(moved.depth, rgb=white if rgb is None else rgb, **changes)
    image = layered(pixels)
    return with_local_motion(image_gaussians(image, KEY_TIMES_S), image, objects)


def rendered(found: GaussianSet) -> Tensor:
    """The input view at the first frame."""
    scene = Scene(
        gaussians=found.gaussians,
        motion=found.motion,
        path=sliding_path(CAMERA, 2, (0.0, 0.0, 0.0)),
        provenance=Provenance(generator="test"),
        dilation_px2=0.0,
    )
    return render(scene, CAMERA, 0.0).rgb


def extent_px(found: GaussianSet, time_s: float) -> tuple[float, float]:
    """Width and height of what moves, in pixels of the input view."""
    state = found.motion.state_at(found.gaussians, time_s)
    at, _ = project(CAMERA, state.means[found.motion.moving_index])
    width, height = (at.amax(0) - at.amin(0)).tolist()
    return width, height


def test_what_grows_grows_in_the_image_and_its_gaussians_with_it() -> None:
    found, count = followed("grows")
    assert count == SIDE**2 == len(found.gaussians)
    before, after = extent_px(found, 0.0), extent_px(found, 2.0)
    assert after == pytest.approx([1.6 * side for side in before], rel=0.02)
    first, last = (found.motion.state_at(found.gaussians, at) for at in (0.0, 2.0))
    index = found.motion.moving_index
    torch.testing.assert_close(last.scales[index], 1.6 * first.scales[index])
    # It grows from its foot.
    feet = [project(CAMERA, state.means[index])[0][:, 1].max() for state in (first, last)]
    torch.testing.assert_close(*feet, atol=1.0, rtol=0)


@pytest.mark.parametrize("motion", ["spins", "twists"])
def test_what_turns_gets_a_back_that_the_input_view_does_not_see(motion: str) -> None:
    found, count = followed(motion)
    assert count == SIDE**2 < len(found.gaussians)
    shown = torch.arange(len(found.gaussians)) < count
    front = replace(
        found, gaussians=found.gaussians.select(shown), motion=found.motion.select(shown)
    )
    seen, wanted = (rendered(one) for one in (found, front))
    assert float((seen - wanted).abs().max()) < 0.05


@pytest.mark.parametrize(("motion", "vanishes"), [("spins", True), ("grows", False)])
def test_an_outline_of_other_colours_vanishes_once_the_object_turns(
    motion: str, vanishes: bool
) -> None:
    rgb = maps().event[..., None].expand(-1, -1, 3).float().clone()
    # Too far from the outline to say that its colour is one of the object's.
    far = FIRST + 2 * (LAST - FIRST) // 3
    rgb[FIRST:LAST, FIRST], rgb[FIRST:LAST, far] = 0.2, 0.2
    found, count = followed(motion, rgb=rgb)
    outline, inner = (
        torch.tensor([row * SIDE + column for row in range(FIRST, LAST)]) for column in (FIRST, far)
    )
    assert count == SIDE**2
    first, last = (found.motion.state_at(found.gaussians, at).scales for at in (0.0, 2.0))
    shrinks = (last / first)[:, 0]
    assert bool((shrinks[inner] > 0.9).all())
    assert bool((shrinks[outline] < 0.05).all()) == vanishes
    torch.testing.assert_close(first, found.gaussians.scales)


def test_half_a_turn_shows_the_back() -> None:
    found, count = followed("spins")
    time_s = next(
        float(at)
        for at in torch.linspace(0, 2, 400)
        if 0.625 * (at / 2 + 0.3 * (at / 2) ** 2) / 1.3 >= 0.5
    )
    state = found.motion.state_at(found.gaussians, time_s)
    middle = (project(CAMERA, state.means)[0] - SIDE / 2).abs().amax(1) < 2
    z = state.means[:, 2]
    assert float(z[count:][middle[count:]].min()) < float(z[:count][middle[:count]].min())


@pytest.mark.parametrize("seconds", [10 / 3, 1e-3])
def test_what_is_at_rest_at_all_latent_frames_moves_between_them(seconds: float) -> None:
    times_s = torch.linspace(0, seconds, 17)
    asked = replace(request("sways"), key_times_s=tuple(times_s.tolist()))
    moved, objects = with_moving_objects(maps(), [asked], round_bodies=True)
    assert bool(moved.displacement.any(-1).any(0)[maps().event > 0].all())
    assert float(moved.displacement.abs().max()) < 0.5
    pixels = layer(moved.depth, displacement=moved.displacement, in_image=True)
    image = layered(pixels)
    found, _ = with_local_motion(image_gaussians(image, times_s), image, objects)
    assert len(found.motion.moving_index) == (LAST - FIRST) ** 2
    moves = float(found.motion.offsets.abs().max())
    assert moves > 0.02 if seconds > 1 else moves < 0.02


def test_without_travel_nothing_rolls() -> None:
    assert with_moving_objects(maps(), [request("rolls")], round_bodies=True)[1] is None
    found, objects = with_moving_objects(maps(travel=1.0), [request("rolls")], round_bodies=True)
    assert len(objects.objects) == 1
    assert not torch.equal(found.displacement, maps(travel=1.0).displacement)


def test_small_objects_do_not_turn_but_grow() -> None:
    scale = (LEAST_SIDE_PX - 1) / (LAST - FIRST)
    for motion, count in (("spins", None), ("grows", 1)):
        small = maps(image_scale=scale)
        objects = with_moving_objects(small, [request(motion)], round_bodies=True)[1]
        assert (None if objects is None else len(objects.objects)) == count


@pytest.mark.parametrize("motion", ["", "slides"])
def test_other_motions_change_nothing(motion: str) -> None:
    given = maps(travel=1.0)
    found, objects = with_moving_objects(given, [request(motion)], round_bodies=True)
    assert objects is None and found is given


def test_given_depth_stays() -> None:
    found, objects = with_moving_objects(maps(), [request("spins")], round_bodies=False)
    assert torch.equal(found.depth, maps().depth)
    assert float(objects.objects[0].frame.foot[2]) == DEPTH
    rounded, _ = with_moving_objects(maps(), [request("spins")], round_bodies=True)
    assert not torch.equal(rounded.depth, maps().depth)


def test_seeds_turn_to_both_sides() -> None:
    x = []
    for seed in (0, 1):
        moved, _ = with_moving_objects(maps(), [request("spins", seed=seed)], round_bodies=True)
        x.append(moved.displacement[1, SIDE // 2, SIDE // 2, 0])
    assert float(x[0]) == pytest.approx(-float(x[1]), rel=0.05)
    assert abs(float(x[0])) > 0.1


def test_each_component_has_its_own_frame() -> None:
    given = maps()
    event = given.event.clone()
    event[:, 22:26] = 0
    objects = with_moving_objects(
        replace(given, event=event), [request("grows")], round_bodies=True
    )[1]
    left, right = (one.frame.foot[0] for one in objects.objects)
    assert float(left) < 0 < float(right)


def test_what_is_between_two_surfaces_does_not_follow() -> None:
    moved, objects = with_moving_objects(maps(), [request("grows")], round_bodies=True)
    depth = moved.depth.clone()
    depth[FIRST, FIRST:LAST] = 4 * DEPTH
    image = layered(layer(depth, displacement=moved.displacement, in_image=True))
    found, count = with_local_motion(image_gaussians(image, KEY_TIMES_S), image, objects)
    assert count == len(found.gaussians) == SIDE**2 - (LAST - FIRST)


def test_static_layers_and_other_objects_stay_as_they_are() -> None:
    moved, objects = with_moving_objects(maps(), [request("spins")], round_bodies=True)
    behind = layer(torch.full((SIDE, SIDE), 2 * DEPTH))
    image = layered(layer(moved.depth, displacement=moved.displacement, in_image=True), behind)
    found, count = with_local_motion(image_gaussians(image, KEY_TIMES_S), image, objects)
    means = found.gaussians.means
    late = found.motion.state_at(found.gaussians, 2.0).means
    assert count == SIDE**2
    assert torch.equal(means[count : 2 * count], late[count : 2 * count])


def test_extended_layers_of_what_turns_are_left_out() -> None:
    moved, objects = with_moving_objects(maps(), [request("spins")], round_bodies=True)
    pixels = layer(moved.depth, displacement=moved.displacement, in_image=True)
    behind = layer(moved.depth + 0.1, displacement=moved.displacement)
    image, plain = layered(pixels, behind), layered(pixels)
    found, _ = with_local_motion(image_gaussians(image, KEY_TIMES_S), image, objects)
    alone, _ = with_local_motion(image_gaussians(plain, KEY_TIMES_S), plain, objects)
    moving = int(moved.displacement.any(-1).any(0).sum())
    assert len(found.gaussians) - len(alone.gaussians) == SIDE**2 - moving


def test_without_key_frames_nothing_changes() -> None:
    image = layered(layer(torch.full((SIDE, SIDE), DEPTH), in_image=True))
    found = image_gaussians(image, KEY_TIMES_S)
    nothing = MovingObjects(
        camera=CAMERA, number=torch.zeros(SIDE, SIDE, dtype=torch.long), objects=()
    )
    assert with_local_motion(found, image, nothing) == (found, SIDE**2)


def test_a_rolling_square_turns_as_far_as_it_travels() -> None:
    travel = 5.0
    given = maps(travel=travel)
    moved, objects = with_moving_objects(given, [request("rolls")], round_bodies=True)
    frame = objects.objects[0].frame
    top = frame.foot - torch.tensor([0.0, frame.height, 0.0])
    middle = (top + frame.foot) / 2
    late = objects.objects[0].positions(top[None], 1.0)[0] - torch.tensor([travel, 0.0, 0.0])
    angle = math.atan2(*(late - middle)[:2].flip(0)) - math.atan2(*(top - middle)[:2].flip(0))
    assert angle % (2 * math.pi) == pytest.approx(2 * travel / frame.height, rel=1e-3)
    assert float(moved.displacement[2, SIDE // 2, SIDE // 2, 0]) == pytest.approx(travel, abs=1.0)
