"""Model folders of version 1, whose priors lay inside ``ldrm`` and ``dit``, keep loading.

tests/golden/model_v1 was written by the last release of version 1: random weights in half
precision, and beside them the outputs of its networks, at every second or fourth pixel. Optical
flow has changed since, so it is left out: the deformation network gets none.
"""

import json
import math
import shutil
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor

from diff4splat.errors import CheckpointError, FileFormatError
from diff4splat.geometry.camera import pinhole
from diff4splat.geometry.rays import plucker_map
from diff4splat.models.hub.checksums import write_sums
from diff4splat.models.hub.model import Model, load_model, save_model
from diff4splat.models.hub.model_info import model_info
from diff4splat.models.hub.weight_files import part_file
from diff4splat.models.ldrm.refinement.motion_features import MOTION_CHANNELS
from diff4splat.models.ldrm.refinement.posed_video import PosedVideo
from diff4splat.models.video_dit.conditions import RenderCondition

GOLDEN = Path(__file__).parents[3] / "golden" / "model_v1"
FRAMES, SIDE_PX = 5, 32


def waves(*shape: int, phase: float = 0.0) -> Tensor:
    """Numbers in [−1, 1] that do not depend on any random generator."""
    x = torch.arange(math.prod(shape), dtype=torch.float64)
    return (x * 0.37 + 0.002 * x * x + phase).sin().float().reshape(shape)


def posed_video() -> PosedVideo:
    poses = torch.eye(4).repeat(1, FRAMES, 1, 1)
    poses[..., 0, 3] = 0.1 * torch.arange(FRAMES)
    cameras = pinhole(30.0, (SIDE_PX, SIDE_PX)).with_pose(poses)
    rgb = 0.5 + 0.5 * waves(1, 3, FRAMES, SIDE_PX, SIDE_PX)
    return PosedVideo(rgb=rgb, cameras=cameras)


def sampled(maps: Tensor) -> Tensor:
    """The pixels that are stored."""
    if maps.dim() == 5 and maps.shape[-1] >= 16:
        return maps[..., ::4, ::4]
    return maps[..., ::2, ::2] if maps.dim() > 3 and maps.shape[-1] > 4 else maps


def without_flow(tokens: Tensor) -> Tensor:
    """Nothing is measured to move; the last channel is depth."""
    features, motion = tokens.tensor_split([-MOTION_CHANNELS], 1)
    return torch.cat([features, torch.zeros_like(motion[:, :-1]), motion[:, -1:]], 1)


@torch.no_grad()
def outputs(model: Model) -> dict[str, Tensor]:
    """What every network makes of the same inputs."""
    networks, video = model.networks, posed_video()
    rays, image = plucker_map(video.cameras).movedim(1, 2), video.rgb[:, :, 0]
    latents = networks.vae.encode(video.rgb * 2 - 1)
    text = networks.text_encoder.encode_prompt("waves")
    maps = networks.ldrm(latents.mean, rays, video)
    level, noise = torch.tensor([0.7]), waves(1, 3, 1, 8, 8)
    motion, mask = networks.motion_unet.predict_motion_and_mask(image, noise, level, text)
    condition = RenderCondition(
        latent=waves(1, 3, 2, 4, 4, phase=1.0), validity=torch.rand(1, 1, FRAMES, SIDE_PX, SIDE_PX)
    )
    levels = torch.tensor([[0.0, 0.7]])
    return {
        "vae.mean": latents.mean,
        "vae.log_variance": latents.log_variance,
        "vae.video": networks.vae.decode(latents.mean),
        "text_encoder": text,
        "ldrm.gaussians": maps.gaussians,
        "ldrm.tokens": torch.cat([maps.tokens[:, :-MOTION_CHANNELS], maps.tokens[:, -1:]], 1),
        "ldrm.border": maps.border,
        "deformation": networks.deformation(without_flow(maps.tokens), torch.tensor([0.5])),
        "monocular_depth": networks.monocular_depth(image),
        "motion_unet.motion": motion,
        "motion_unet.mask": mask[:, None],
        "dit": networks.dit(waves(1, 3, 2, 4, 4), levels, rays, text, None, condition),
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(GOLDEN, tmp_path / "model"))


def rewrite(folder: Path, part: str, change: dict[str, Tensor | None]) -> None:
    tensors = load_file(part_file(folder, part)) | change
    kept = {key: value for key, value in tensors.items() if value is not None}
    save_file(kept, part_file(folder, part))
    write_sums(folder)


def assert_equal_outputs(model: Model) -> None:
    stored = load_file(GOLDEN / "outputs.safetensors")
    found = outputs(model)
    assert found.keys() == stored.keys()
    for name, want in stored.items():
        got = sampled(found[name])
        torch.testing.assert_close(got, want, atol=1e-3, rtol=1e-3, msg=lambda m, n=name: n + m)


def test_every_network_gives_what_it_gave() -> None:
    """The video model's latent too: with zero motion channels they changed nothing."""
    assert_equal_outputs(load_model(GOLDEN))


def test_saved_again_it_is_version_2_with_equal_outputs(tmp_path: Path) -> None:
    model = load_model(GOLDEN)
    save_model(model, tmp_path / "model")
    assert json.loads((tmp_path / "model" / "config.json").read_text())["version"] == 2
    assert {file.stem for file in (tmp_path / "model").glob("*.safetensors")} == set(model.parts)
    again = load_model(tmp_path / "model")
    assert again.trained == frozenset(model.parts)
    assert_equal_outputs(again)


def test_priors_are_trained_where_the_part_was_that_held_them(folder: Path) -> None:
    record = json.loads((folder / "provenance.json").read_text()) | {"trained": ["ldrm"]}
    (folder / "provenance.json").write_text(json.dumps(record))
    write_sums(folder)
    assert load_model(folder).trained == {"ldrm", "monocular_depth"}
    states = model_info(folder).states
    assert (states["monocular_depth"], states["motion_unet"]) == ("trained", "untrained")


def test_the_video_model_loses_its_motion_channels() -> None:
    old = load_file(part_file(GOLDEN, "dit"))
    new = load_model(GOLDEN, parts=("dit",)).networks.dit.state_dict()
    assert old["patch_embedding.weight"].shape == (8, 60)
    assert torch.equal(new["patch_embedding.weight"], old["patch_embedding.weight"][:, :12].float())
    condition = "condition_embedding.latent.weight"
    assert torch.equal(new[condition], old["draft_embedding.weight"][:, :12].float())
    head = old["head.bias"].float().unflatten(0, (4, 15))
    assert torch.equal(new["head.bias"].unflatten(0, (4, 3)), head[:, :3])
    assert not new["condition_embedding.validity.weight"].any()


def test_other_weights_of_the_video_model_are_kept() -> None:
    old = load_file(part_file(GOLDEN, "dit"))
    new = load_model(GOLDEN, parts=("dit",)).networks.dit.state_dict()
    changed = ("patch_embedding", "condition_embedding", "head")
    kept = {key: value for key, value in new.items() if not key.startswith(changed)}
    assert len(kept) > 40
    for key, value in kept.items():
        assert torch.equal(value, old[key].float()), key


def test_a_prior_is_read_from_the_file_that_held_it(folder: Path) -> None:
    rewrite(folder, "dit", {"head.bias": torch.full((60,), float("nan"))})
    part_file(folder, "vae").unlink()
    write_sums(folder)
    model = load_model(folder, parts=("motion_unet", "monocular_depth"))
    assert model.loaded == {"motion_unet", "monocular_depth"}
    with pytest.raises(CheckpointError, match=r"expected finite numbers in head\.bias"):
        load_model(folder, parts=("dit",))


@pytest.mark.parametrize(
    ("part", "key", "asked"),
    [
        ("ldrm", "detail.picture_depth.head.bias", "monocular_depth"),
        ("dit", "motion_branch.untold", "motion_unet"),
        ("ldrm", "detail.pixels.looks.bias", "ldrm"),
        ("vae", "code.to_block.bias", "vae"),
    ],
)
def test_loading_stays_strict(folder: Path, part: str, key: str, asked: str) -> None:
    rewrite(folder, part, {key: None})
    with pytest.raises(CheckpointError, match=f"{asked} weights: missing 1 "):
        load_model(folder, parts=(asked,))
    rewrite(folder, part, {f"{key}_extra": torch.zeros(1)})
    with pytest.raises(CheckpointError, match=f"{asked} weights: "):
        load_model(folder, parts=(asked,))


def test_a_damaged_file_is_named_when_a_prior_inside_is_asked_for(folder: Path) -> None:
    file = part_file(folder, "ldrm")
    file.write_bytes(file.read_bytes()[:-1])
    load_model(folder, parts=("vae", "motion_unet"))
    with pytest.raises(FileFormatError, match=r"ldrm\.safetensors: expected SHA-256"):
        load_model(folder, parts=("monocular_depth",))
