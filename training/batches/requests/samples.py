"""Samples of the object mask: an image and prompts."""

import torch

from diff4splat.training.batches.requests.image_requests import draw_image_requests
from diff4splat.training.batches.requests.object_image import random_object_image
from diff4splat.training.batches.requests.present import name_maps
from diff4splat.training.batches.requests.request_batch import RequestBatch, collate_requests
from diff4splat.training.batches.samples import SamplesOfClips
from diff4splat.training.stage import SampleKey

REQUESTS = 5
"""Prompts per image: they cost little beside the image."""


class RequestSamples(SamplesOfClips):
    """Images with prompts, from the clips that a recipe names."""

    def __getitem__(self, sample_index: int) -> RequestBatch:
        """A batch of one image.

        Raises:
            Diff4SplatError: the clip cannot be used; another index may do.
        """
        key = SampleKey(self.clips.seed, self.recipe.name, sample_index, "requests")
        generator = key.generator()
        clip, source, settings = self.clips.clip(sample_index)
        seen = random_object_image(clip, self.recipe.data.size_px, generator)
        empty = torch.zeros(seen.image.shape[:2], dtype=torch.bool)
        requests = draw_image_requests(seen.objects, empty, REQUESTS, generator)
        nouns, colors = name_maps(seen.objects, empty)
        return RequestBatch(
            sample_index=torch.tensor([sample_index]),
            source=(source,),
            images=seen.image[None],
            masks=torch.stack([request.mask for request in requests])[None],
            nouns=nouns[None],
            colors=colors[None],
            objects=seen.numbers[None],
            has_requests=torch.tensor([settings.motion_loss != "never"]),
            captions=tuple(request.caption for request in requests),
        )

    def collate(self, samples: list[RequestBatch]) -> RequestBatch:
        """Samples as one batch."""
        return collate_requests(samples)
