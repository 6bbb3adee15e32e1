"""Samples of the object mask: any frame of a clip, a random part of it, and prompts for it.

Axes: ``h w`` pixels.
"""

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.training.batches.requests.image_requests import draw_image_requests
from diff4splat.training.batches.requests.present import name_maps, named_objects
from diff4splat.training.batches.requests.request_batch import RequestBatch, collate_requests
from diff4splat.training.batches.samples import ClipSamples
from diff4splat.training.recipe.stage import StageRecipe
from diff4splat.training.stage import SampleKey

REQUESTS = 5
"""Prompts per image: they cost little beside the image."""
WHOLE_SHARE, LEAST_PART = 0.5, 0.55
"""Share of images that are shown whole; least side of a part, as a share of the image's."""


class RequestSamples:
    """Images with prompts, from the clips that a recipe names."""

    def __init__(self, clips: ClipSamples) -> None:
        self.clips, self.recipe = clips, clips.recipe

    @classmethod
    def open(cls, recipe: StageRecipe, seed: int) -> "RequestSamples":
        """The sources that the recipe names.

        Raises:
            InputError, FileFormatError: a folder is not one of shards.
        """
        return cls(ClipSamples.open(recipe, seed))

    def __getitem__(self, sample_index: int) -> RequestBatch:
        """A batch of one image.

        Raises:
            Diff4SplatError: the clip cannot be used; another index may do.
        """
        clip, source = self.clips.clip(sample_index)
        key = SampleKey(self.clips.seed, self.recipe.name, sample_index, "requests")
        generator = key.generator()
        image, instances = _random_part(clip, self.recipe.data.size_px, generator)
        objects = named_objects(clip.note, instances)
        empty = torch.zeros(instances.shape, dtype=torch.bool)
        requests = draw_image_requests(objects, empty, REQUESTS, generator)
        nouns, colors = name_maps(objects, empty)
        return RequestBatch(
            sample_index=torch.tensor([sample_index]),
            source=(source,),
            images=image[None],
            masks=torch.stack([request.mask for request in requests])[None],
            nouns=nouns[None],
            colors=colors[None],
            captions=tuple(request.caption for request in requests),
        )

    def collate(self, samples: list[RequestBatch]) -> RequestBatch:
        """Samples as one batch."""
        return collate_requests(samples)


def _random_part(
    clip: Clip, size_px: tuple[int, int], generator: torch.Generator
) -> tuple[UInt8[Tensor, "h w 3"], UInt8[Tensor, "h w"]]:
    """A part of some frame, mirrored half of the time, with its instances."""
    view = clip.views[int(torch.randint(len(clip.views), (), generator=generator))]
    if view.instances is None:
        raise InputError(
            f"clip {clip.note.identifier}: expected masks of objects, got none; "
            "leave the source out"
        )
    frame = int(torch.randint(clip.frames, (), generator=generator))
    mirror, whole, share, top, left = torch.rand(5, generator=generator).tolist()
    share = 1.0 if whole < WHOLE_SHARE else LEAST_PART + (1 - LEAST_PART) * share
    height, width = (round(share * side) for side in clip.size_px)
    top, left = round(top * (clip.size_px[0] - height)), round(left * (clip.size_px[1] - width))
    window = slice(top, top + height), slice(left, left + width)
    maps = [view.rgb[frame][window].numpy(), view.instances[frame][window].numpy()]
    if mirror < 0.5:
        maps = [np.ascontiguousarray(one[:, ::-1]) for one in maps]
    kinds = (cv2.INTER_AREA if height > size_px[0] else cv2.INTER_CUBIC, cv2.INTER_NEAREST)
    rgb, instances = (
        cv2.resize(one, size_px[::-1], interpolation=kind)
        for one, kind in zip(maps, kinds, strict=True)
    )
    return torch.from_numpy(rgb), torch.from_numpy(instances)
