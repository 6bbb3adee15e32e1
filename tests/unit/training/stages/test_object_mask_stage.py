"""The stage of the object mask: what learns, what is measured, and random light."""

from dataclasses import replace

import pytest
import torch
from stage_fixtures import make_stage, shake_heads, stage_recipe

from diff4splat.errors import ConfigError
from diff4splat.models.config.model import MotionUNetConfig, ObjectMaskConfig
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.object_mask.enlarged import reduced
from diff4splat.models.object_mask.instance_vectors import membership_logits
from diff4splat.training.batches.requests.request_batch import RequestBatch
from diff4splat.training.recipe.losses import ObjectMaskLosses
from diff4splat.training.recipe.recipe import Recipe
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import TOTAL

BASE = tiny_size()
MODEL = replace(
    BASE, motion_unet=MotionUNetConfig(width=8, heads=1), object_mask=ObjectMaskConfig(width=4)
)


WITH_INSTANCES = replace(
    MODEL, object_mask=replace(MODEL.object_mask, width=8, instance_channels=4)
)


def mask_recipe() -> StageRecipe:
    return replace(
        stage_recipe("video_diffusion"),
        name="object_mask",
        kind="object_mask",
        trained=("object_mask",),
        losses=ObjectMaskLosses(),
    )


def requests(first: int = 0) -> RequestBatch:
    """Two images; the left half is asked for, then nothing."""
    torch.manual_seed(first)
    masks = torch.zeros(2, 2, 32, 32, dtype=torch.bool)
    masks[:, 0, :, :16] = True
    return RequestBatch(
        sample_index=torch.tensor([first, first + 1]),
        source=("x", "x"),
        images=torch.randint(256, (2, 32, 32, 3)).to(torch.uint8),
        masks=masks,
        nouns=masks[:, 0].to(torch.uint8) * 3,
        colors=masks[:, 0].to(torch.uint8) * 2,
        objects=masks[:, 0].to(torch.uint8),
        has_requests=torch.tensor([True, True]),
        captions=("a red ball rolls", "nothing moves") * 2,
    )


def test_terms_and_gradients_are_finite_and_only_the_object_mask_learns() -> None:
    stage = make_stage(mask_recipe(), model=MODEL)
    shake_heads(stage)
    terms = stage(requests())
    assert set(terms) == {"cross_entropy", "dice", "names", TOTAL}
    terms[TOTAL].sum().backward()
    gradients = {name: p.grad for name, p in stage.named_parameters() if p.grad is not None}
    assert gradients and all(name.startswith("object_mask.") for name in gradients)
    assert all(bool(gradient.isfinite().all()) for gradient in gradients.values())


def test_it_learns_which_half_is_asked_for() -> None:
    stage, batch = make_stage(mask_recipe(), model=MODEL), requests()
    optimiser = torch.optim.Adam(stage.object_mask.parameters(), lr=1e-2)
    for _ in range(60):
        optimiser.zero_grad()
        stage(batch)[TOTAL].mean().backward()
        optimiser.step()
    measured = stage.eval().measure(batch)
    assert float(measured["overlap"].mean()) > 0.8
    assert float(measured["found"].mean()) == 1.0
    assert float(measured["absent_empty"].mean()) == 1.0


@pytest.mark.slow
def test_it_learns_the_names_of_pixels() -> None:
    stage, batch = make_stage(mask_recipe(), model=MODEL), requests()
    optimiser = torch.optim.Adam(stage.object_mask.parameters(), lr=1e-2)
    errors = []
    for _ in range(60):
        optimiser.zero_grad()
        terms = stage(batch)
        terms[TOTAL].mean().backward()
        optimiser.step()
        errors.append(float(terms["names"].detach().mean()))
    assert errors[-1] < 0.3 * errors[0]


def test_measures_have_no_value_where_no_prompt_is_of_their_kind() -> None:
    stage = make_stage(mask_recipe(), model=MODEL).eval()
    nothing = replace(requests(), masks=torch.zeros(2, 2, 32, 32, dtype=torch.bool))
    measured = stage.measure(nothing)
    assert bool(measured["overlap"].isnan().all()) and bool(measured["found"].isnan().all())
    assert bool(measured["absent_empty"].isfinite().all())


def test_images_get_another_light_and_another_sharpness() -> None:
    recipe = mask_recipe()
    recipe = replace(recipe, data=replace(recipe.data, view_sides_px=(16, 32)))
    stage, sharp = make_stage(recipe, model=MODEL), set()
    for first in range(0, 16, 2):
        batch = requests(first)
        plain = batch.images.movedim(-1, 1) / 255
        seen = stage._random_sharpness(batch)
        sharp.add(torch.allclose(seen, plain, atol=1e-3))
        lit = stage._random_light(seen, batch)
        assert lit.shape == plain.shape and 0 <= float(lit.min()) <= float(lit.max()) <= 1
        assert not torch.allclose(lit, seen, atol=1e-3)
        assert torch.equal(lit, stage._random_light(seen, batch))
    assert sharp == {True, False}


def test_the_network_sees_enlarged_images(monkeypatch: pytest.MonkeyPatch) -> None:
    stage, sizes = make_stage(mask_recipe(), model=MODEL), []
    features = stage.object_mask.features

    def recorded(image: torch.Tensor) -> torch.Tensor:
        sizes.append(tuple(image.shape[-2:]))
        return features(image)

    monkeypatch.setattr(stage.object_mask, "features", recorded)
    stage(requests())
    stage.measure(requests())
    assert sizes == [(48, 48)] * 2


def test_panel() -> None:
    image = make_stage(mask_recipe(), model=MODEL).eval().panel(requests())
    assert image.ndim == 3 and bool(image.isfinite().all())


def test_the_kind_needs_an_object_mask() -> None:
    with pytest.raises(ConfigError, match=r"object_mask\.width: expected an object mask"):
        Recipe(name="x", seed=0, model=BASE, stages=(mask_recipe(),))


def test_an_object_mask_needs_a_motion_prior() -> None:
    with pytest.raises(ConfigError, match=r"ObjectMaskConfig\.width: expected 0 without"):
        replace(BASE, object_mask=ObjectMaskConfig(width=4))


def instance_recipe() -> StageRecipe:
    return replace(mask_recipe(), losses=ObjectMaskLosses(instances=1.0))


def two_squares() -> RequestBatch:
    """Two equal squares on a plain ground, which differ in their place alone."""
    objects = torch.zeros(2, 32, 32, dtype=torch.uint8)
    objects[:, 4:12, 4:12], objects[:, 18:26, 20:28] = 1, 2
    images = torch.full((2, 32, 32, 3), 60, dtype=torch.uint8)
    images[objects > 0] = torch.tensor([200, 40, 40], dtype=torch.uint8)
    return replace(requests(), images=images, objects=objects)


@pytest.mark.slow
def test_it_learns_which_pixels_are_one_object() -> None:
    stage, batch = make_stage(instance_recipe(), model=WITH_INSTANCES), two_squares()
    optimiser = torch.optim.Adam(stage.object_mask.parameters(), lr=1e-2)
    for _ in range(80):
        optimiser.zero_grad()
        terms = stage(batch)
        terms[TOTAL].mean().backward()
        optimiser.step()
    assert float(terms["instances"].detach().mean()) < 0.5
    vectors = reduced(stage.object_mask.instances(stage._features(_unit(batch))), (32, 32))
    seed = torch.zeros(2, 1, 32, 32)
    seed[:, :, 8, 8] = 1
    found = membership_logits(vectors, seed.flatten(2))[:, 0] > 0
    own, other = (found[batch.objects == number].double().mean() for number in (1, 2))
    assert float(own) > 0.9 and float(other) < 0.1


def _unit(batch: RequestBatch) -> torch.Tensor:
    return batch.images.movedim(-1, 1) / 255


def test_images_whose_requests_do_not_count_teach_objects_alone() -> None:
    stage = make_stage(instance_recipe(), model=WITH_INSTANCES)
    shake_heads(stage)
    batch = replace(two_squares(), has_requests=torch.tensor([True, False]))
    terms = {name: value.detach() for name, value in stage(batch).items()}
    for name in ("cross_entropy", "dice", "names"):
        assert float(terms[name][0]) > 0 and float(terms[name][1]) == 0
    assert float(terms["instances"].min()) > 0


def test_the_loss_of_instances_needs_a_network_that_has_them() -> None:
    with pytest.raises(ConfigError, match=r"instance_channels: expected 2 or more"):
        Recipe(name="x", seed=0, model=MODEL, stages=(instance_recipe(),))
    with pytest.raises(ConfigError, match="instance_channels: expected 0, or 2 or more"):
        ObjectMaskConfig(width=4, instance_channels=1)
    with pytest.raises(ConfigError, match="instance_channels: expected 0, or 2 or more"):
        ObjectMaskConfig(instance_channels=4)
