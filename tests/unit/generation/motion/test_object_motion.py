"""What the motion prior adds to the maps of an image."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb
from torch import Tensor

from diff4splat.generation.inputs.copies import Copies
from diff4splat.generation.inputs.input_image import enlarged
from diff4splat.generation.layered_image.pixel_maps.image_maps import FineMaps, ImageMaps
from diff4splat.generation.motion import object_motion
from diff4splat.generation.motion.object_motion import ObjectMotion
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.hub.model import Model
from diff4splat.models.networks import Networks
from diff4splat.progress.run_log import RunLog

SIDE = 16
MOVING = (slice(4, 10), slice(4, 10))


def moved(
    monkeypatch: pytest.MonkeyPatch, depth: Tensor, scale: int = 2, *, given: bool = False
) -> ImageMaps:
    """Maps of an image of which a box moves by one unit to the right."""
    event = torch.zeros(scale * SIDE, scale * SIDE, dtype=torch.long)
    rows, columns = (slice(scale * one.start, scale * one.stop) for one in MOVING)
    event[rows, columns] = 1
    displacement = (event > 0)[None, ..., None] * torch.tensor([1.0, 0.0, 0.0])
    monkeypatch.setattr(ObjectMotion, "_events", lambda *_: event)
    monkeypatch.setattr(ObjectMotion, "_displacement", lambda *_: displacement)
    small = size_by_name("small")
    unet = replace(small.motion_unet, input_scale=scale)
    model = Model(config=replace(small, motion_unet=unet))
    image = input_image(random_rgb(SIDE, SIDE))
    motion = ObjectMotion(model=model, frames=1, requests=(), log=RunLog())
    fine = FineMaps(rgb=image.rgb, depth=depth, smooth=False) if given else None
    maps = ImageMaps(depth=depth, displacement=None, fine=fine)
    return motion.added_to(maps, Copies(image=image, small=image))


@pytest.mark.parametrize("scale", [1, 2])
def test_background_in_the_edge_of_what_moves_moves_as_far_in_the_image(
    monkeypatch: pytest.MonkeyPatch, scale: int
) -> None:
    depth = torch.full((SIDE, SIDE), 9.0)
    depth[4:10, 4:9] = 3.0
    maps = moved(monkeypatch, depth, scale)
    in_image = (maps.displacement[0, ..., 0] / maps.depth)[MOVING]
    # Unbounded, the last column would move by a third.
    assert float(in_image.min()) > 0.8 * float(in_image.max())
    assert float(maps.depth[6, 9]) < 4 and float(maps.depth[6, 12]) == 9.0


@pytest.mark.parametrize("given", [True, False])
def test_a_slope_moves_as_far_in_the_image_and_at_given_depth_in_space(
    monkeypatch: pytest.MonkeyPatch, given: bool
) -> None:
    depth = torch.full((SIDE, SIDE), 9.0)
    depth[4:10, 4:10] = torch.linspace(3.0, 3.4, 6)
    maps = moved(monkeypatch, depth, 1, given=given)
    inner = (slice(5, 9), slice(5, 9))
    offsets, depth = maps.displacement[0, ..., 0][inner], maps.depth[inner]
    even = offsets if given else offsets / depth
    torch.testing.assert_close(even, even[:1, :1].expand_as(even), atol=1e-4, rtol=0)
    assert float(depth.max() / depth.min()) > 1.05


@pytest.mark.parametrize("scale", [1, 2])
def test_maps_have_the_body_of_what_turns(monkeypatch: pytest.MonkeyPatch, scale: int) -> None:
    side = 64
    event = torch.zeros(scale * side, scale * side, dtype=torch.long)
    event[scale * 16 : scale * 48, scale * 16 : scale * 48] = 1
    monkeypatch.setattr(ObjectMotion, "_events", lambda *_: event)
    request = MotionRequest(
        text=None, seed=0, settings=GenerationSettings(), local_motion="spins", in_place=True
    )
    small = size_by_name("small")
    unet = replace(small.motion_unet, input_scale=scale)
    model = Model(config=replace(small, motion_unet=unet))
    image = input_image(random_rgb(side, side))
    motion = ObjectMotion(model=model, frames=3, requests=(request,), log=RunLog())
    given = ImageMaps(depth=torch.full((side, side), 9.0), displacement=None)
    maps = motion.added_to(given, Copies(image=image, small=image))
    assert len(maps.objects.objects) == 1
    middle, outline = float(maps.depth[32, 32]), float(maps.depth[32, 17])
    assert middle < 8.9 and outline > 9.1
    assert bool((maps.depth[:10] == 9.0).all())
    assert bool(maps.displacement.any(-1).any(0)[20:44, 20:44].all())


def darkened(monkeypatch: pytest.MonkeyPatch, value: float, *, in_place: bool = False) -> ImageMaps:
    """The same maps by a model with a network that sees that shadow everywhere."""

    def network(image: Tensor, mask: Tensor) -> Tensor:
        assert float(mask.max()) == 1 and 0 < float(mask.mean()) < 0.5
        return torch.full_like(image, value)

    networks = Networks(object_shadow=network)
    request = MotionRequest(
        text=None,
        seed=0,
        settings=GenerationSettings(),
        local_motion="spins" if in_place else "",
        in_place=in_place,
    )
    side = 64
    event = torch.zeros(side, side, dtype=torch.long)
    event[16:48, 16:48] = 1
    moving = (event > 0)[None, ..., None] * torch.tensor([0.0 if in_place else 2.0, 0.0, 0.0])
    monkeypatch.setattr(ObjectMotion, "_events", lambda *_: event)
    monkeypatch.setattr(ObjectMotion, "_displacement", lambda *_: moving)
    small = size_by_name("small")
    config = replace(small, motion_unet=replace(small.motion_unet, input_scale=1))
    model = Model(config=config, networks=networks)
    image = input_image(0.3 * random_rgb(side, side))
    motion = ObjectMotion(model=model, frames=1, requests=(request,), log=RunLog())
    maps = ImageMaps(depth=torch.full((side, side), 3.0), displacement=None)
    return motion.added_to(maps, Copies(image=image, small=image))


def test_what_is_displaced_has_a_shadow_with_its_displacement(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (shadow,) = darkened(monkeypatch, 0.3).shadows
    assert torch.allclose(shadow.displacement, torch.tensor([[2.0, 0.0, 0.0]]))
    assert torch.allclose(shadow.darkening, torch.full((64, 64, 3), 0.3), atol=1e-5)


def test_no_shadow_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert darkened(monkeypatch, 0.0).shadows == ()


def test_what_spins_in_place_keeps_its_shadow(monkeypatch: pytest.MonkeyPatch) -> None:
    assert darkened(monkeypatch, 0.3, in_place=True).shadows == ()


def test_a_shadow_stays_with_an_object_that_is_too_small_to_move(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept = darkened(monkeypatch, 0.3)
    monkeypatch.setattr(object_motion, "with_majority_displacement", lambda maps, *_: maps)
    monkeypatch.setattr(object_motion, "motion_copy", lambda images, _: enlarged(images.small, 1))
    lost = darkened(monkeypatch, 0.3)
    assert kept.shadows and lost.displacement is None and lost.shadows == ()
