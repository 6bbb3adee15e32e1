"""The protocol at another size, clips drawn once, and an autoencoder that loses nothing."""

import pytest
import torch
from ablations.evaluation import DrawnOnce, TruePictures, held_out, protocol_at
from clip_shards import exact_clip

from diff4splat.data.clip import Clip
from diff4splat.errors import InputError
from diff4splat.evaluation.protocols.protocol_json import load_protocol
from diff4splat.models.config.sizes import size_by_name
from diff4splat.models.factory import create_networks


class Counted:
    """A source that counts how often it was asked."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def __len__(self) -> int:
        return 5

    def clip(self, index: int) -> Clip:
        self.asked.append(index)
        return exact_clip(index, static=True)


def test_another_size_is_another_protocol_on_the_same_clips_and_pairs() -> None:
    shipped, found = load_protocol("held_out_v2").protocol, protocol_at((64, 64))
    assert found.name == "held_out_v2 at 64 px"
    assert found.digest != shipped.digest
    assert found.digest != protocol_at((32, 32)).digest
    assert (found.source, found.reconstruction) == (shipped.source, shipped.reconstruction)
    assert (found.size_px, found.input_stride) == ((64, 64), 2)


@pytest.mark.parametrize("items", [0, 65])
def test_items_must_be_within_the_protocol(items: int) -> None:
    with pytest.raises(InputError, match=f"--items: expected 1 to 64 .*got {items}"):
        held_out((64, 64), items)


def test_worlds_are_not_drawn_before_they_are_asked_for() -> None:
    found = held_out((64, 64), 24)
    assert (len(found.clips), found.clips.kept) == (64, {})


def test_a_clip_is_drawn_once() -> None:
    source = Counted()
    clips = DrawnOnce(source)
    assert clips.clip(3) is clips.clip(3)
    assert clips.clip(1) is not clips.clip(3)
    assert (source.asked, len(clips)) == ([3, 1], 5)


def test_true_pictures_come_back_as_they_went_in_with_the_latents_of_the_autoencoder() -> None:
    vae = create_networks(size_by_name("test")).vae.eval()
    vae.set_statistics(torch.full((4,), 0.5), torch.full((4,), 2.0))
    video = torch.rand(1, 3, 5, 32, 32, generator=torch.Generator().manual_seed(0)) * 2 - 1
    found = TruePictures(vae).eval()
    latent = found.encode(video).mean
    assert torch.equal(latent, vae.encode(video).mean)
    assert torch.equal(found.decode(latent), video)
