"""What a classifier of cells says for classes that a prompt names.

Axes: ``b`` images, ``r`` prompts of an image, ``k`` classes, ``hc wc`` cells.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

LEAST_SHARE = 1e-30
"""Of the most probable class: less has no finite logarithm in float32."""


def class_evidence(
    logits: Float[Tensor, "b k hc wc"], classes: Bool[Tensor, "b r k"]
) -> Float[Tensor, "b r 2 hc wc"]:
    """Of ``classes`` together: their logit above the mean of all, and their log probability.

    The probability is small where a cell shows something else; the logit is not, if that something
    is like them. 0 for prompts without classes.
    """
    # In half precision the least share would be 0, and its logarithm infinite.
    logits = logits.to(torch.promote_types(logits.dtype, torch.float32))
    highest = logits.amax(1, keepdim=True)
    shares = (logits - highest).exp()
    ours = torch.where(classes[..., None, None], shares[:, None], 0.0).sum(2)
    together = ours.clamp_min(LEAST_SHARE).log()
    above_mean = together + highest - logits.mean(1, keepdim=True)
    probability = together - shares.sum(1, keepdim=True).log()
    named = classes.any(-1)[:, :, None, None, None]
    return torch.where(named, torch.stack([above_mean, probability], 2), 0.0)
