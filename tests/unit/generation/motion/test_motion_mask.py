"""What moves: the probability of every pixel, and the mask that it gives."""

import math
from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb

from diff4splat.generation.inputs.input_image import InputImage
from diff4splat.generation.motion.motion_mask import (
    MotionProbability,
    bilateral_smooth,
    event_of_pixels,
    motion_probability,
)
from diff4splat.generation.motion.networks import LEAST_PROBABILITY, LEAST_SHARE, MaskedMotion
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.generation.settings import GenerationSettings
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.motion_unet.unet import MotionUNet

SIDE_PX = 32


@pytest.fixture
def network() -> MotionUNet:
    """Fresh, but sure that everything moves."""
    network = MotionUNet(8, 1, tiny_size().text)
    with torch.no_grad():
        network.mask_head.bias.fill_(5.0)
    return network


def request(text: bool = False) -> MotionRequest:
    torch.manual_seed(3)
    states = torch.randn(1, 4, tiny_size().text.width) if text else None
    return MotionRequest(text=states, seed=0, settings=GenerationSettings())


def image() -> InputImage:
    return input_image(random_rgb(SIDE_PX, SIDE_PX))


def sample_of(probability: torch.Tensor) -> MotionProbability:
    return MotionProbability(probability=probability)


def test_the_most_probable_moves_where_nothing_is_probable() -> None:
    probability = torch.tensor([[0.05, 0.2], [0.3, 0.14]])
    sample = sample_of(probability)
    assert sample.mask(0.5).tolist() == [[False, True], [True, False]]
    assert sample.mask(0.1).tolist() == [[False, True], [True, True]]
    assert not sample_of(0 * probability).mask(0.3).any()
    assert bool(sample_of(probability + 0.6).mask(0.5).all())


@pytest.mark.parametrize(("highest", "moves"), [(0.49, False), (0.51, True), (0.0, False)])
def test_nothing_moves_below_the_least_probability(highest: float, moves: bool) -> None:
    sample = replace(sample_of(torch.tensor([[highest, 0.1]])), least_probability=0.5)
    assert sample.mask(0.3).tolist() == [[moves, False]]


def test_components_far_below_the_highest_are_other_objects() -> None:
    probability = torch.zeros(5, 9)
    probability[1:4, 1:3], probability[1:4, 4], probability[1:4, 6:8] = 0.9, 0.8, 0.6
    sample = replace(sample_of(probability), least_share=0.85)
    assert torch.equal(sample.mask(0.3), probability > 0.7)
    assert torch.equal(sample_of(probability).mask(0.3), probability > 0)


def test_a_pixel_far_below_the_highest_is_no_part_of_its_component() -> None:
    probability = torch.tensor([[0.9, 0.4, 0.25, 0.0]])
    sample = replace(sample_of(probability), low_share=0.35)
    assert sample.mask(0.2).tolist() == [[True, True, False, False]]
    assert sample_of(probability).mask(0.2).tolist() == [[True, True, True, False]]


class Square:
    """Finds a square with one probability, whatever the prompt."""

    def __init__(self, probability: float) -> None:
        self.logit = math.log(probability / (1 - probability))

    def __call__(self, image: torch.Tensor, text: torch.Tensor) -> torch.Tensor:
        """The logit in the middle, almost nothing elsewhere."""
        del text
        height, width = image.shape[2:]
        logits = torch.full((1, height, width), -9.0)
        logits[:, height // 4 : 3 * height // 4, width // 4 : 3 * width // 4] = self.logit
        return logits

    def predict_mask_and_instances(
        self, image: torch.Tensor, text: torch.Tensor, text_mask: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, None]:
        """The logits, and no vectors."""
        del text_mask
        return self(image, text), None


@torch.no_grad()
@pytest.mark.parametrize(("probability", "found"), [(0.9, True), (0.2, False)])
def test_the_object_mask_says_what_moves(
    network: MotionUNet, probability: float, found: bool
) -> None:
    gray = input_image(torch.full((SIDE_PX, SIDE_PX, 3), 0.5))
    masked = MaskedMotion(motion_unet=network, object_mask=Square(probability))
    sample = motion_probability(masked, gray, 2, request(text=True))
    assert (sample.least_probability, sample.least_share) == (LEAST_PROBABILITY, LEAST_SHARE)
    mask = sample.mask(0.3)
    assert bool(mask[12:20, 12:20].all()) is found and not bool(mask[0, 0])


class HalfFound(Square):
    """A square of which the words find the left half, and which knows that it is one."""

    def predict_mask_and_instances(
        self, image: torch.Tensor, text: torch.Tensor, text_mask: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Logits of the left half; vectors that are 0 on the square and far from it elsewhere."""
        logits = self(image, text)
        square = logits > -9
        logits[..., logits.shape[-1] // 2 :] = -9.0
        far = 9.0 * (~square).float()
        return logits, torch.stack([far, 0 * far, 0 * far], 1)


@torch.no_grad()
def test_an_object_moves_whole_where_words_find_half_of_it(network: MotionUNet) -> None:
    gray = input_image(torch.full((SIDE_PX, SIDE_PX, 3), 0.5))
    masked = MaskedMotion(motion_unet=network, object_mask=HalfFound(0.9))
    mask = motion_probability(masked, gray, 2, request(text=True)).mask(0.2)
    assert float(mask[11:21, 11:21].double().mean()) > 0.95
    assert not mask[:4].any() and not mask[:, -4:].any()


@torch.no_grad()
def test_its_own_mask_counts_without_an_object_mask(network: MotionUNet) -> None:
    sample = motion_probability(network, image(), 3, request(text=True))
    assert sample.probability.shape == (SIDE_PX, SIDE_PX)
    assert float(sample.probability.min()) > 0.99 and sample.least_probability == 0


@torch.no_grad()
def test_without_text_nothing_is_named(network: MotionUNet) -> None:
    masked = MaskedMotion(motion_unet=network, object_mask=Square(0.9))
    assert bool(motion_probability(masked, image(), 2, request()).mask(0.3).all())


@pytest.mark.parametrize(("second", "moves"), [(0.39, False), (0.41, True)])
def test_a_component_moves_where_some_of_it_is_probable(second: float, moves: bool) -> None:
    probability = torch.full((6, 9), 0.2)
    probability[1:3, 1:4] = torch.tensor([[0.4, 0.5, 0.35], [0.4, 0.95, 0.4]])
    probability[2:5, 6:8] = torch.tensor([[0.35, 0.31], [0.38, second], [0.29, 0.35]])
    wanted = probability > 0.3
    wanted[:, 5:] &= moves
    assert torch.equal(sample_of(probability).mask(0.3), wanted)


def test_the_most_probable_component_moves_whole() -> None:
    probability = torch.zeros(6, 9)
    probability[1:3, 1:4], probability[1, 1], probability[4:, 6:] = 0.32, 0.38, 0.36
    wanted = torch.zeros(6, 9, dtype=torch.bool)
    wanted[1:3, 1:4] = True
    assert torch.equal(sample_of(probability).mask(0.3), wanted)


def test_probabilities_are_averaged_within_a_colour_and_not_across() -> None:
    rgb = torch.zeros(1, 3, SIDE_PX, SIDE_PX)
    rgb[..., 16:] = 1.0
    probability = torch.zeros(1, SIDE_PX, SIDE_PX)
    probability[:, :, 12:16] = 1.0
    smooth = bilateral_smooth(probability, rgb)
    assert float(smooth[0, 16, 10]) > 0.1
    assert float(smooth[0, :, 16:].max()) < 1e-3
    flat = torch.full((1, SIDE_PX, SIDE_PX), 0.4)
    torch.testing.assert_close(bilateral_smooth(flat, torch.rand(1, 3, SIDE_PX, SIDE_PX)), flat)


def test_a_pixel_belongs_to_the_event_that_is_surest_of_it() -> None:
    first = sample_of(torch.tensor([[0.9, 0.9, 0.5, 0.0, 0.0]]))
    second = sample_of(torch.tensor([[0.0, 0.35, 0.5, 0.5, 0.0]]))
    assert event_of_pixels([first, second], 0.3).tolist() == [[1, 1, 2, 2, 0]]
    assert event_of_pixels([second, first], 0.3).tolist() == [[2, 2, 1, 1, 0]]
    nothing = replace(second, least_probability=0.9)
    assert event_of_pixels([nothing, first], 0.3).tolist() == [[2, 2, 2, 0, 0]]
    assert not event_of_pixels([nothing, sample_of(0 * first.probability)], 0.3).any()
