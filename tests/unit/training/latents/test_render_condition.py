"""What the first frame of a clip shows along its path: validity, true motion, and its render."""

from dataclasses import dataclass, replace

import pytest
import torch

from diff4splat.configs.recipes import recipe_by_name
from diff4splat.data.clip import Clip, ClipMetadata, Tracks, View
from diff4splat.generation.video.render_condition import RenderedImage
from diff4splat.geometry.camera import pinhole
from diff4splat.models.config.model import MonocularDepthConfig
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model
from diff4splat.models.ldrm.plane_prior import PLANE_DEPTH
from diff4splat.training.batches.clip_batch import collate
from diff4splat.training.batches.sample import Origin, make_sample
from diff4splat.training.latents import video_latents
from diff4splat.training.latents.encode import encode_clip
from diff4splat.training.latents.latent_shards import LatentPack
from diff4splat.training.latents.video_latents import encode_batch
from diff4splat.training.recipe.data import DataSettings
from diff4splat.training.stage import SampleKey

SIDE, FRAMES, FOCAL_PX = 32, 5, 32.0
ROWS, COLUMNS = slice(8, 24), slice(8, 16)
"""Pixels of the box in the first frame."""
RED, GREY = torch.tensor([220, 30, 30]).byte(), torch.tensor([120, 120, 120]).byte()
DATA = DataSettings(size_px=(SIDE, SIDE), frames=FRAMES, views=1)
PX = PLANE_DEPTH / FOCAL_PX
"""Length of a pixel on the plane of the image."""


def box_clip(box_px: float = 0.0, camera_px: float = 0.0) -> Clip:
    """A box and its background on the plane; both paths go right by so many pixels altogether."""
    progress = torch.linspace(0, 1, FRAMES)
    poses = torch.eye(4).repeat(FRAMES, 1, 1)
    poses[:, 0, 3] = camera_px * PX * progress
    rgb = GREY.repeat(FRAMES, SIDE, SIDE, 1)
    rgb[:, ROWS, COLUMNS] = RED
    instances = torch.ones(FRAMES, SIDE, SIDE, dtype=torch.uint8)
    instances[:, ROWS, COLUMNS] = 2
    start = torch.tensor([[12.0, 12.0], [12.0, 20.0], [28.0, 4.0]])
    center = torch.cat([(start - SIDE / 2) * PX, torch.full((3, 1), PLANE_DEPTH)], 1)
    moves = torch.tensor([[1.0], [1.0], [0.0]]) * torch.tensor([box_px * PX, 0.0, 0.0])
    view = View(
        rgb=rgb,
        depth=torch.full((FRAMES, SIDE, SIDE), PLANE_DEPTH),
        cameras=pinhole(FOCAL_PX, (SIDE, SIDE)).with_pose(poses),
        instances=instances,
        track_uv=start.repeat(FRAMES, 1, 1),
        track_visible=torch.ones(FRAMES, 3, dtype=torch.bool),
    )
    tracks = Tracks(
        positions=center + progress[:, None, None] * moves,
        instances=torch.tensor([2, 2, 1], dtype=torch.uint8),
        found_at=torch.zeros(3, 2, dtype=torch.long),
    )
    note = ClipMetadata(identifier="box", source="test", license="CC0-1.0", is_static=box_px == 0)
    return Clip(note=note, times_s=torch.arange(FRAMES) / 8, views=(view,), tracks=tracks)


def model_of(depth_channels: int = 0) -> Model:
    """With render conditions, and with a depth prior where it has channels."""
    config = recipe_by_name("test").model
    config = replace(
        config,
        dit=replace(config.dit, render_condition=True),
        monocular_depth=MonocularDepthConfig(channels=depth_channels),
    )
    return Model(config=config, networks=create_networks(config))


def deep_model() -> Model:
    """Its depth prior puts every image on one plane that lies deeper than the usual one."""
    model = model_of(depth_channels=4)
    with torch.no_grad():
        for parameter in model.networks.monocular_depth.parameters():
            parameter.zero_()
        model.networks.monocular_depth.head.bias.fill_(1.0)
    return model


@dataclass(frozen=True)
class Rendered:
    pack: LatentPack
    image: RenderedImage

    @property
    def valid(self) -> torch.Tensor:
        """(f, h, w)"""
        return self.pack.validity[0, 0]


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch):
    """Encodes a clip and keeps the render that its condition was made from."""
    images: list[RenderedImage] = []
    encode = video_latents.encode_condition

    def keep(model: Model, image: RenderedImage):
        images.append(image)
        return encode(model, image)

    monkeypatch.setattr(video_latents, "encode_condition", keep)

    def run(clip: Clip, model: Model | None = None) -> Rendered:
        pack = encode_clip(model or model_of(), clip, DATA)
        return Rendered(pack, images[-1])

    return run


def assert_mask(found: torch.Tensor, expected: torch.Tensor) -> None:
    """Equal but for the pixels at edges, which Gaussians cover in part."""
    spread = torch.nn.functional.max_pool2d
    one = expected.float()[None]
    edge = (spread(one, 3, 1, 1) != -spread(-one, 3, 1, 1))[0]
    assert torch.equal(found[~edge], expected[~edge])


def hole(first: int, last: int) -> torch.Tensor:
    """All valid but for columns ``first`` to ``last`` in the rows of the box."""
    valid = torch.ones(SIDE, SIDE, dtype=torch.bool)
    valid[ROWS, first:last] = False
    return valid


def test_a_static_clip_of_a_static_camera_is_all_valid(rendered) -> None:
    found = rendered(box_clip())
    assert bool(found.valid.all())
    torch.testing.assert_close(found.image.rgb[-1], found.image.rgb[0], atol=0.02, rtol=0)


def test_a_moving_box_uncovers_the_background(rendered) -> None:
    found = rendered(box_clip(box_px=8))
    assert bool(found.valid[0].all())
    assert_mask(found.valid[-1], hole(8, 16))
    # Half of the way at half of the time.
    assert_mask(found.valid[2], hole(8, 12))


def test_a_moving_camera_reveals_a_border(rendered) -> None:
    found = rendered(box_clip(camera_px=4))
    expected = torch.ones(SIDE, SIDE, dtype=torch.bool)
    expected[:, -4:] = False
    assert bool(found.valid[0].all())
    assert_mask(found.valid[-1], expected)


def test_box_and_camera_move_together(rendered) -> None:
    found = rendered(box_clip(box_px=12, camera_px=4))
    expected = hole(4, 12)
    expected[:, -4:] = False
    assert bool(found.valid[0].all())
    assert_mask(found.valid[-1], expected)


def test_the_box_is_rendered_with_its_true_motion(rendered) -> None:
    last = rendered(box_clip(box_px=12, camera_px=4)).image.rgb[-1]
    red = last[..., 0] - last[..., 2] > 0.4
    expected = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    expected[ROWS, 16:24] = True
    assert_mask(red, expected)


def test_the_first_frame_is_the_image_itself(rendered) -> None:
    clip = box_clip(box_px=8, camera_px=4)
    found = rendered(clip)
    assert torch.equal(found.image.rgb[0], clip.views[0].rgb[0] / 255)
    torch.testing.assert_close(found.pack.render_latent[:, :, 0], found.pack.latent[:, :, 0])


def without_motion(clip: Clip) -> Clip:
    """The same images of which nobody knows what moves."""
    views = [replace(v, instances=None, track_uv=None, track_visible=None) for v in clip.views]
    return replace(clip, views=tuple(views), tracks=None)


def test_unknown_motion_is_not_shown_as_stillness(rendered) -> None:
    found = rendered(without_motion(box_clip(box_px=8)))
    assert bool(found.valid[0].all()) and not bool(found.valid[1:].any())


def test_batches_tell_the_video_model_which_motion_is_known() -> None:
    """The static clip beside it keeps what it shows."""
    origin = Origin(key=SampleKey(0, "video_diffusion", 0, "sample"), source="made")
    clips = without_motion(box_clip(box_px=8)), without_motion(box_clip())
    batch = collate([make_sample(clip, DATA, origin) for clip in clips])
    unknown, static = encode_batch(model_of(), batch).validity[:, 0].bool()
    assert bool(unknown[0].all()) and not bool(unknown[1:].any())
    assert bool(static.all())


def test_the_depth_prior_sets_the_depth(rendered) -> None:
    """The deeper the image, the less of a border a translation reveals."""
    found = rendered(box_clip(camera_px=8), deep_model())
    depth = found.image.depth[0]
    torch.testing.assert_close(depth, depth[0, 0].expand_as(depth))
    ratio = float(depth[0, 0]) / PLANE_DEPTH
    assert ratio > 1.2
    expected = torch.ones(SIDE, SIDE, dtype=torch.bool)
    expected[:, SIDE - round(8 / ratio) :] = False
    assert_mask(found.valid[-1], expected)


def test_displacement_scales_with_the_predicted_depth(rendered) -> None:
    """Motion is relative to depth: the box moves as far in the image at any depth."""
    assert_mask(rendered(box_clip(box_px=8), deep_model()).valid[-1], hole(8, 16))


def test_models_without_render_conditions_make_none() -> None:
    config = recipe_by_name("test").model
    model = Model(config=config, networks=create_networks(config))
    pack = encode_clip(model, box_clip(box_px=8), DATA)
    assert pack.render_latent is None and pack.validity is None
