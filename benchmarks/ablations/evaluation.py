"""Evaluates trained variants on the same held-out worlds, at the size they were trained at.

The protocol is ``held_out_v2`` at another size, with a digest of its own. Its paths for loops and
recovered cameras are cut short: no column here shows them.
"""

from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from ablations.variants import Variant
from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.evaluation.measure_item import Setup
from diff4splat.evaluation.protocols.datasets import open_clips
from diff4splat.evaluation.protocols.protocol import Protocol
from diff4splat.evaluation.protocols.protocol_json import LoadedProtocol, load_protocol
from diff4splat.evaluation.protocols.sources import ClipSource
from diff4splat.evaluation.report.result_store import NAME, ItemStore, run_key
from diff4splat.evaluation.runner import Outcome, require_results, run_items
from diff4splat.evaluation.systems.evaluated_system import (
    Reconstructor,
    model_identity,
    reconstruct_clip,
)
from diff4splat.models.hub.model import Model, load_model
from diff4splat.models.networks import reconstruction_parts
from diff4splat.models.video_vae.latent_distribution import LatentDistribution
from diff4splat.models.video_vae.vae import VideoVae
from diff4splat.progress.phases import Phases
from diff4splat.training.train_stage import MODEL_FOLDER

SHIPPED = "held_out_v2"
SHORTEST = 2
"""Frames that a path of a protocol must have."""


@dataclass(frozen=True, slots=True)
class DrawnOnce:
    """Clips of a source, each made when it is first asked for and kept."""

    source: ClipSource
    kept: dict[int, Clip] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.source)

    def clip(self, index: int) -> Clip:
        """The clip at ``index``."""
        if index not in self.kept:
            self.kept[index] = self.source.clip(index)
        return self.kept[index]


class TruePictures(VideoVae):
    """An autoencoder whose decoder answers with the video that was encoded last."""

    def __init__(self, vae: VideoVae) -> None:
        super().__init__(vae.config)
        self.load_state_dict(vae.state_dict())
        self.video: Tensor | None = None

    def encode(self, video: Float[Tensor, "b 3 f hh ww"]) -> LatentDistribution:
        """As the autoencoder does."""
        self.video = video
        return super().encode(video)

    def decode(self, latent: Float[Tensor, "b c t h w"]) -> Float[Tensor, "b 3 f hh ww"]:
        """The video itself, whatever the latent."""
        del latent
        return self.video


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """What all variants are evaluated on."""

    protocol: Protocol
    clips: ClipSource
    items: int
    """The first so many clips of the protocol."""


def held_out(size_px: tuple[int, int], items: int) -> HeldOut:
    """The shipped protocol at another size, and its worlds.

    Raises:
        InputError: the protocol has fewer items.
    """
    protocol = protocol_at(size_px)
    if not 1 <= items <= protocol.source.count:
        count = protocol.source.count
        raise InputError(f"--items: expected 1 to {count} for {protocol.name}, got {items}")
    clips = DrawnOnce(open_clips(LoadedProtocol(protocol=protocol, folder=Path())))
    return HeldOut(protocol=protocol, clips=clips, items=items)


def protocol_at(size_px: tuple[int, int]) -> Protocol:
    """The shipped protocol at another size."""
    protocol = load_protocol(SHIPPED).protocol.at_size(size_px)
    return replace(
        protocol,
        loop=replace(protocol.loop, frames=SHORTEST),
        pose=replace(protocol.pose, frames=SHORTEST, size_px=size_px),
    )


def evaluate(variant: Variant, folder: Path, held_out: HeldOut, phases: Phases) -> Outcome:
    """Measure every item that was not measured before.

    Raises:
        InputError: all items failed.
        Diff4SplatError: the trained model cannot be loaded.
    """
    model = load_model(folder / MODEL_FOLDER)
    pictures = "true pictures" if variant.use_ground_truth_frames else "decoded pictures"
    parts = reconstruction_parts(model.config)
    identity = model_identity(model, parts, f"reconstruction, {pictures}")
    subject = Reconstructor(
        reconstruct=partial(reconstruct_clip, _seeing(model, variant)),
        identity=replace(identity, name=variant.name, untrained=False),
    )
    setup = Setup(protocol=held_out.protocol, task="reconstruction", system=subject)
    store = ItemStore(folder / NAME, run_key(setup))
    return require_results(run_items(held_out.clips, setup, store, held_out.items, phases))


def _seeing(model: Model, variant: Variant) -> Model:
    if not variant.use_ground_truth_frames:
        return model
    return replace(model, networks=replace(model.networks, vae=TruePictures(model.networks.vae)))
