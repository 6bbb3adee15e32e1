"""Logits of an object mask, corrected by a public image classifier (ours, ADR 44).

Axes: ``b`` images, ``r`` prompts of an image, ``h w`` pixels, ``k`` classes, ``c`` channels.

    image × 2, × 4 ─ classifier of cells ─┐
    classes of the prompt ────────────────┴ evidence ─┐
    logits of the object mask ────────────────────────┴ · ─ correction of cells of 4 px ─ logits

The classifier keeps its public weights; the correction alone is trained. It sees single cells and
the highest values of the image, so it cannot learn shapes: those are the object mask's. Where no
cell is likely to show what a prompt names, the mask stays: drawn objects are often not recognised.
"""

import math

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from diff4splat.models.image_classifier.class_evidence import class_evidence
from diff4splat.models.image_classifier.classifier import CellClassifier

ENLARGEMENTS = (2, 4)
"""Of the image's sides: objects of all sizes shall fill a cell."""
CELL_PX = 4
MASK_SCALE, EVIDENCE_SCALES = 4.0, (5.0, 8.0)
"""Logits of the mask, and both kinds of evidence, in units of about 1."""
LEAST_PROBABILITY = 0.1
"""Of the classes of a prompt in some cell, for the mask to be corrected (chosen on validation
worlds and photographs: docs/log/image-classifier.md)."""
WIDTH = 32
MAPS = 1 + 2 * len(ENLARGEMENTS)


class ImageClassifier(nn.Module):
    """Public weights, and the correction that they give."""

    def __init__(self) -> None:
        super().__init__()
        self.cells = CellClassifier()
        self.input = nn.Conv2d(4 * MAPS, WIDTH, 1)
        self.hidden = nn.Conv2d(WIDTH, WIDTH, 1)
        self.output = nn.Conv2d(WIDTH, 1, 1)
        nn.init.zeros_(self.output.weight)
        nn.init.zeros_(self.output.bias)

    def forward(
        self,
        image: Float[Tensor, "b 3 h w"],
        mask_logits: Float[Tensor, "b r h w"],
        classes: Bool[Tensor, "b r k"],
    ) -> Float[Tensor, "b r h w"]:
        """The corrected logits; as they are for prompts without classes that may be there.

        ``image`` is RGB in [0, 1], its sides multiples of 16.
        """
        cells = torch.nn.functional.avg_pool2d(mask_logits, CELL_PX) / MASK_SCALE
        size = cells.shape[-2:]
        maps = torch.cat([cells[:, :, None], *self._evidence(image, classes, size)], 2)
        correction = self._correction(maps.flatten(0, 1)).unflatten(0, maps.shape[:2])
        likely = classes.any(-1) & self._is_likely(maps)
        correction = torch.where(likely[..., None, None], correction, 0.0)
        return mask_logits + torch.nn.functional.interpolate(
            correction, mask_logits.shape[-2:], mode="bilinear", align_corners=False
        )

    def _evidence(
        self,
        image: Float[Tensor, "b 3 h w"],
        classes: Bool[Tensor, "b r k"],
        size: tuple[int, int],
    ) -> list[Float[Tensor, "b r 2 hc wc"]]:
        """At every enlargement, resized to ``size``."""
        scales = image.new_tensor(EVIDENCE_SCALES)[:, None, None]
        found = []
        for factor in ENLARGEMENTS:
            larger = torch.nn.functional.interpolate(
                image, scale_factor=float(factor), mode="bicubic", align_corners=False
            )
            with torch.no_grad():
                logits = self.cells(larger.clamp(0, 1))
            evidence = class_evidence(logits, classes) / scales
            resized = torch.nn.functional.interpolate(
                evidence.flatten(1, 2), size, mode="bilinear", align_corners=False
            )
            found.append(resized.unflatten(1, evidence.shape[1:3]))
        return found

    def _is_likely(self, maps: Float[Tensor, "b r c hc wc"]) -> Bool[Tensor, "b r"]:
        """Whether some cell shows the classes, at any enlargement."""
        least = math.log(LEAST_PROBABILITY) / EVIDENCE_SCALES[1]
        return maps[:, :, 2::2].amax((-3, -2, -1)) > least

    def _correction(self, maps: Float[Tensor, "n c hc wc"]) -> Float[Tensor, "n hc wc"]:
        """From every cell, the highest values, and those where the mask is most probable."""
        highest = maps.amax((-2, -1), keepdim=True)
        weights = (2 * MASK_SCALE * maps[:, :1]).flatten(2).softmax(-1).unflatten(2, maps.shape[2:])
        probable = (maps * weights).sum((-2, -1), keepdim=True)
        whole = torch.cat([highest, probable], 1).expand(-1, -1, *maps.shape[2:])
        states = torch.nn.functional.silu(self.input(torch.cat([maps, maps - highest, whole], 1)))
        states = states + torch.nn.functional.silu(self.hidden(states))
        return self.output(states)[:, 0]
