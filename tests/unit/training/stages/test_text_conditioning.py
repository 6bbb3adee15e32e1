"""Captions of a batch: encoded in groups of like lengths, each as if it were alone."""

from dataclasses import replace

import torch
from stage_fixtures import make_batch, make_stage, stage_recipe

from diff4splat.training.stages.text_conditioning import GROUP, TextConditioning

COUNT = GROUP + 9


def test_groups_change_nothing() -> None:
    recipe = stage_recipe("video_diffusion")
    stage, batch = make_stage(recipe), make_batch(recipe, (0,))
    text = TextConditioning(encoder=stage.text_encoder, plan=stage.plan)
    captions = tuple("a red ball rolls " * (1 + (7 * index) % 5) for index in range(COUNT))
    states, mask = text.encode(replace(batch, captions=captions), training=False)
    assert states.shape[:2] == mask.shape == (COUNT, max(map(len, captions)) + 2)
    for index in (0, 3, COUNT - 1):
        own, _ = text.encode(replace(batch, captions=captions[index : index + 1]), training=False)
        length = int(mask[index].sum())
        torch.testing.assert_close(states[index, :length], own[0], atol=1e-5, rtol=1e-4)
        assert not bool(states[index, length:].any())
