"""The motion prior's sample: fields of objects, seeds and guidance."""

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.flow.guidance import Guidance
from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.motion.sampling import MotionRequest, initial_noise, sample_motion
from diff4splat.generation.settings import GenerationSettings, MotionSettings
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.motion_unet.unet import MotionUNet

SIDE_PX = 32


@pytest.fixture
def network() -> MotionUNet:
    """Fresh, but for what every test sets itself."""
    return MotionUNet(8, 1, tiny_size().text)


def moves_right(network: MotionUNet, units: float) -> MotionUNet:
    """Everything moves to the right."""
    with torch.no_grad():
        network.motion_head.bias[0] = units
    return network


def request(text: bool = False, seed: int = 0, **changes: object) -> MotionRequest:
    torch.manual_seed(3)
    states = torch.randn(1, 4, tiny_size().text.width) if text else None
    settings = GenerationSettings(motion=MotionSettings(**changes))
    return MotionRequest(text=states, seed=seed, settings=settings)


def image() -> InputImage:
    return input_image(random_rgb(SIDE_PX, SIDE_PX))


@torch.no_grad()
def test_motion_starts_at_zero_and_ends_at_the_prediction(network: MotionUNet) -> None:
    sample = sample_motion(moves_right(network, 2.0), image(), 3, request())
    assert sample.field.shape == (3, 3, SIDE_PX // 4, SIDE_PX // 4)
    assert not sample.field[:, 0].any()
    later = sample.field[0, 1:]
    torch.testing.assert_close(later, torch.full_like(later, 2.0))
    assert torch.equal(sample.mean_field, sample.field), "one step gives the mean"
    assert sample.calls.conditional == 0 < sample.calls.unconditional


@torch.no_grad()
def test_seeds_decide_and_repeat(network: MotionUNet) -> None:
    torch.nn.init.normal_(network.motion_head.weight)
    fields = [sample_motion(network, image(), 2, request(seed=seed)).field for seed in (0, 1, 0)]
    assert torch.equal(fields[0], fields[2])
    assert not torch.allclose(fields[0], fields[1])


@torch.no_grad()
@pytest.mark.parametrize(("weight", "passes"), [(1.0, (8, 0)), (3.0, (8, 8)), (0.0, (0, 8))])
def test_guidance_runs_only_the_passes_that_it_needs(
    network: MotionUNet, weight: float, passes: tuple[int, int]
) -> None:
    guided = request(text=True, guidance=Guidance(weight=weight), steps=8)
    calls = sample_motion(network, image(), 2, guided).calls
    assert (calls.conditional, calls.unconditional) == passes


@torch.no_grad()
@pytest.mark.parametrize("steps", [1, 4])
def test_an_object_has_a_field_by_its_own_mask(steps: int) -> None:
    network = MotionUNet(8, 1, tiny_size().text, object_mask=True)
    for parameter in (network.input_mask.weight, network.motion_head.weight):
        torch.nn.init.normal_(parameter)
    masks = torch.zeros(2, SIDE_PX, SIDE_PX, dtype=torch.bool)
    masks[0, 4:12, 4:12] = masks[1, 20:30, 8:28] = True
    asked = request(text=True, steps=steps)
    one, other = (sample_motion(network, image(), 3, asked, mask) for mask in masks)
    for first, second in ((one.field, other.field), (one.mean_field, other.mean_field)):
        assert not torch.allclose(first, second)
    assert torch.allclose(one.mean_field, one.field) is (steps == 1)
    nothing = sample_motion(network, image(), 3, asked, masks[0] & False)
    torch.testing.assert_close(nothing.field, sample_motion(network, image(), 3, asked).field)


@torch.no_grad()
def test_several_steps_have_a_mean_of_their_own(network: MotionUNet) -> None:
    torch.nn.init.normal_(network.motion_head.weight)
    asked = request(text=True, steps=4)
    sample = sample_motion(network, image(), 2, asked)
    rgb, noise = image().rgb.movedim(-1, 0)[None], initial_noise(image(), 2, 0)
    mean = network(rgb, noise, torch.ones(1), asked.text)
    torch.testing.assert_close(sample.mean_field[:, 1:], mean[0])
