"""Samples of the object shadow: an image, and the same without one of its objects.

Axes: ``v h w`` views and pixels of a clip.
"""

import torch
from jaxtyping import Bool
from torch import Tensor

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.training.batches.random_images.random_window import draw_window
from diff4splat.training.batches.samples import SamplesOfClips
from diff4splat.training.batches.shadows.shadow_batch import ShadowBatch, collate_shadows
from diff4splat.training.stage import SampleKey

LEAST_STRENGTH = 1e-3
"""Added to the mean brightness of a shadow: objects without any are shown, too."""


class ShadowSamples(SamplesOfClips):
    """Pairs of images, from the clips that a recipe names."""

    def __getitem__(self, sample_index: int) -> ShadowBatch:
        """A batch of one pair.

        Raises:
            Diff4SplatError: the clip cannot be used; another index may do.
        """
        key = SampleKey(self.clips.seed, self.recipe.name, sample_index, "shadows")
        generator = key.generator()
        clip, source, _ = self.clips.clip(sample_index)
        pairs = views_without_object(clip)
        strength = torch.tensor([shadow_strength(clip, *pair) for pair in pairs])
        view, mask = pairs[int(torch.multinomial(strength, 1, generator=generator))]
        window = draw_window(clip.size_px, self.recipe.data.size_px, generator)
        images = [window.colors(clip.views[at].rgb[0]) for at in (0, view)]
        return ShadowBatch(
            sample_index=torch.tensor([sample_index]),
            source=(source,),
            images=images[0][None],
            without=images[1][None],
            masks=window.labels(mask.byte()).bool()[None],
        )

    def collate(self, samples: list[ShadowBatch]) -> ShadowBatch:
        """Samples as one batch."""
        return collate_shadows(samples)


def shadow_strength(clip: Clip, view: int, mask: Bool[Tensor, "h w"]) -> float:
    """How much brighter the image is without the object, of all pixels; most cast little shadow."""
    first, without = (clip.views[at].rgb[0].float() / 255 for at in (0, view))
    brighter = (without - first).clamp_min(0).mean(-1)
    return LEAST_STRENGTH + float(brighter[~mask].sum()) / mask.numel()


def views_without_object(clip: Clip) -> list[tuple[int, Bool[Tensor, "h w"]]]:
    """Views that lack an object of the first one, and the pixels of that object in the first.

    Raises:
        InputError: there is no such view.
    """
    first = clip.views[0].instances
    pairs = []
    for view in range(1, len(clip.views)):
        instances = clip.views[view].instances
        if first is None or instances is None:
            break
        mask = ~torch.isin(first[0], instances[0])
        if bool(mask.any()):
            pairs.append((view, mask))
    if not pairs:
        raise InputError(
            f"clip {clip.note.identifier}: expected views that lack an object, got none; make "
            "clips with prepare synth --without-objects"
        )
    return pairs
