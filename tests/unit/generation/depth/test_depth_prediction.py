"""Depth of one image from several passes of the depth prior."""

from dataclasses import replace

import pytest
import torch
from depth_priors import DistancePrior, TwoEncoders
from image_layers import random_rgb
from torch import Tensor

from diff4splat.generation.depth import prediction
from diff4splat.generation.depth.fusion import BACKBONE_SHARE, NEAR_RELIEF
from diff4splat.generation.depth.prediction import SCALES, predict_depth
from diff4splat.models.config.networks import ActivationConfig
from diff4splat.models.config.priors import BACKBONE_MULTIPLE_PX
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH

CONFIG = ActivationConfig()


class Ramp(DistancePrior):
    """Depth from the column alone, in a unit that depends on the size: a prior at its worst."""

    def __init__(self, slope: float, unit: float = 0.0) -> None:
        self.slope, self.unit, self.sizes = slope, unit, []

    def distance(self, image: Tensor) -> Tensor:
        self.sizes.append(tuple(image.shape[2:]))
        column = torch.linspace(-1, 1, image.shape[3]).expand(len(image), 1, *image.shape[2:])
        return self.slope * column + self.unit * image.shape[3] / 100


class Brightness(DistancePrior):
    """Depth that the image decides, whichever way round it is."""

    def distance(self, image: Tensor) -> Tensor:
        return image.mean(1, keepdim=True)


class Constant(DistancePrior):
    """The same distance everywhere."""

    def __init__(self, value: float) -> None:
        self.value = value

    def distance(self, image: Tensor) -> Tensor:
        return image[:, :1] * 0 + self.value


def test_an_unsided_prior_gives_the_mirrored_depth_of_the_mirrored_image() -> None:
    rgb = random_rgb(64, 96)
    straight = predict_depth(Brightness(), rgb, CONFIG).depth
    mirrored = predict_depth(Brightness(), rgb.flip(1), CONFIG).depth
    torch.testing.assert_close(mirrored.flip(1), straight, rtol=1e-5, atol=0)


def test_what_the_prior_says_of_a_side_cancels() -> None:
    depth = predict_depth(Ramp(0.3), random_rgb(64, 96), CONFIG).depth
    torch.testing.assert_close(depth, torch.full((64, 96), PLANE_DEPTH))


def test_scales_are_brought_to_the_unit_of_the_image_itself() -> None:
    rgb = random_rgb(64, 64)
    with_unit = predict_depth(Ramp(0.0, 1.0), rgb, CONFIG).depth
    alone = Ramp(0.0, 1.0).distance(rgb.movedim(-1, 0)[None])[0, 0]
    limit = CONFIG.log_distance_limit
    wanted = PLANE_DEPTH * (limit * (alone / limit).tanh()).exp()
    torch.testing.assert_close(with_unit, wanted)


def test_every_scale_is_seen_twice_in_sides_that_the_network_takes() -> None:
    prior = Ramp(0.1)
    predict_depth(prior, random_rgb(128, 256), CONFIG)
    assert len(prior.sizes) == 2 * len(SCALES)
    assert set(prior.sizes) == {(128, 256), (96, 192), (160, 320)}
    assert all(side % BACKBONE_MULTIPLE_PX == 0 for size in prior.sizes for side in size)


def test_scales_of_one_size_are_seen_once() -> None:
    prior = Ramp(0.1)
    depth = predict_depth(prior, random_rgb(32, 32), CONFIG).depth
    assert prior.sizes == [(32, 32)] * 2 and depth.shape == (32, 32)


def unsure() -> TwoEncoders:
    """Encoders that disagree, and are unsure where the image is green."""

    def ridge(image: Tensor) -> Tensor:
        return image[:, :1] * 0 + torch.linspace(-1, 1, image.shape[2])[:, None]

    def other(image: Tensor) -> Tensor:
        return image[:, :1] * 2

    return TwoEncoders(ridge, other, lambda image: image[:, 1:2] * 8 - 6)


def test_unsure_relief_is_shrunk_and_the_log_says_how_unsure() -> None:
    rgb = torch.zeros(32, 64, 3)
    rgb[:, 20:24, :2] = 1.0
    found = predict_depth(unsure(), rgb, CONFIG, SCALES[:1])
    sure = replace(unsure(), log_uncertainty=None)
    plain = predict_depth(sure, rgb, CONFIG, SCALES[:1])
    assert plain.uncertainty is None and set(plain.record()) == {"source", "out_of_domain"}
    assert float(found.out_of_domain) == float(plain.out_of_domain) == 1
    height = [float(one.depth.log()[16, 22] - one.depth.log()[16, 8]) for one in (plain, found)]
    assert abs(height[1]) < 0.3 * abs(height[0])
    assert float(found.uncertainty[16, 22]) > 5 and float(found.uncertainty[16, 8]) < 0.01
    assert float(found.uncertainty[16, 41]) < 0.01
    assert found.record()["median_uncertainty"] == pytest.approx(0.002, abs=0.001)


def test_relief_shrinks_within_the_colours_of_the_image(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def kept(log_depth: Tensor, uncertainty: Tensor, score: Tensor, rgb: Tensor) -> Tensor:
        seen.append(rgb)
        return log_depth

    monkeypatch.setattr(prediction, "shrunk", kept)
    rgb = random_rgb(32, 64)
    predict_depth(unsure(), rgb, CONFIG, SCALES[:1])
    assert len(seen) == 1 and torch.equal(seen[0], rgb)


def test_out_of_domain_the_first_encoder_counts_more() -> None:
    def rows(image: Tensor) -> Tensor:
        return image[:, :1] * 0 + torch.linspace(-0.1, 0.1, image.shape[2])[:, None]

    def columns(image: Tensor) -> Tensor:
        return image[:, :1] * 0 + 0.2 * torch.linspace(-1, 1, image.shape[3]).square()

    ratios = []
    for pair in ((rows, columns), (columns, rows)):
        depth = predict_depth(TwoEncoders(*pair), random_rgb(64, 64), CONFIG, SCALES[:1]).depth
        relief = depth.log() - depth.log().median()
        relief = torch.where(relief < 0, relief / NEAR_RELIEF, relief)
        ratios.append(float(relief.mean(1).std() / relief.mean(0).std()))
    share = BACKBONE_SHARE / (1 - BACKBONE_SHARE)
    assert ratios[0] / ratios[1] == pytest.approx(share**2, rel=0.01)


@pytest.mark.parametrize("value", [-1e30, 1e30])
def test_extreme_outputs_are_finite_depth(value: float) -> None:
    depth = predict_depth(Constant(value), random_rgb(32, 48), CONFIG).depth
    assert bool(depth.isfinite().all()) and bool((depth > 0).all())
