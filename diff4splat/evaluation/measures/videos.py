"""Measures of the target images of the input view as a video, with networks that may be a user's.

Axes: ``p`` target images, ``t`` frames, ``h w`` pixels. Frame consistency is that of VBench (Huang
et al. 2024): the mean cosine of every frame's features with those of the first frame and of the
frame before. The CLIP score is the mean of 100 max(cos, 0) of frames and the caption.
"""

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import cosine_similarity

from diff4splat.evaluation.measures.images import Entries
from diff4splat.evaluation.protocols.sample import EvalSample
from diff4splat.evaluation.records import Embedding, Score, Skip, score
from diff4splat.metrics.features.aesthetic import AestheticScore
from diff4splat.metrics.features.protocol import ImageFeatures, TextImageFeatures, VideoFeatures


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoNetworks:
    """What videos are measured with; None measures nothing."""

    distribution: VideoFeatures | None = None
    """For distances of distributions."""
    frames: ImageFeatures | None = None
    """For the consistency of frames."""
    text: TextImageFeatures | None = None
    """For the CLIP score."""
    aesthetic: AestheticScore | None = None

    @property
    def names(self) -> dict[str, str]:
        """Name of every network, by its purpose."""
        named = {
            "distribution": self.distribution,
            "frames": self.frames,
            "text": self.text,
            "aesthetic": self.aesthetic,
        }
        return {purpose: network.name for purpose, network in named.items() if network}


def video_entries(
    row: str, sample: EvalSample, rgb: Float[Tensor, "p h w 3"], networks: VideoNetworks
) -> Entries:
    """Features and measures of one row; none of fewer than two frames."""
    frames = [index for index, (view, _) in enumerate(sample.targets.pairs) if view == 0]
    if len(frames) < 2:
        return []
    video = rgb[frames].movedim(-1, 1)
    entries: Entries = []
    if networks.distribution is not None:
        values = networks.distribution.embed_videos(video[None])[0].double()
        entries.append(Embedding(row=row, values=tuple(round(v, 6) for v in values.tolist())))
    if networks.frames is not None:
        embedded = networks.frames.embed_images(video).double()
        value = frame_consistency(embedded)
        entries.append(Score(row=row, key="frame_consistency", value=round(value, 6)))
    if networks.text is not None:
        entries.append(_clip_score(row, sample.clip.note.caption, video, networks.text))
    if networks.aesthetic is not None:
        entries.append(score(row, "aesthetic", networks.aesthetic.score(video).tolist()))
    return entries


def frame_consistency(embedded: Float[Tensor, "t d"]) -> float:
    """Mean cosine of all frames but the first with the first one and the one before."""
    to_first = cosine_similarity(embedded[1:], embedded[:1], dim=-1)
    to_last = cosine_similarity(embedded[1:], embedded[:-1], dim=-1)
    return float((to_first + to_last).mean() / 2)


def _clip_score(
    row: str, caption: str, video: Float[Tensor, "t 3 h w"], network: TextImageFeatures
) -> Score | Skip:
    if not caption:
        return Skip(row=row, key="clip_score", why="the clip has no caption")
    cosines = network.embed_images(video) @ network.embed_texts([caption])[0]
    return score(row, "clip_score", (100 * cosines.clamp_min(0)).tolist())
