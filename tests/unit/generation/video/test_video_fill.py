"""The video model's fill: hidden cells alone, or every cell where the image has no geometry."""

from dataclasses import replace

import pytest
import torch
from image_layers import input_image, random_rgb, sliding_path

from diff4splat.generation.layered_image.build import build_layered_image
from diff4splat.generation.layered_image.pixel_maps.image_maps import ImageMaps
from diff4splat.generation.layered_image.types import NO_PIXEL
from diff4splat.generation.settings import GenerationSettings
from diff4splat.generation.text_states import TextStates
from diff4splat.generation.video.video_fill import FillRequest, VideoFill, fill_hidden
from diff4splat.geometry.camera import project
from diff4splat.models.config.sizes import small_size
from diff4splat.models.config.sizes import test_size as tiny_size
from diff4splat.models.factory import create_networks
from diff4splat.models.hub.model import Model
from diff4splat.progress.run_log import RunLog
from diff4splat.scene.motion.static import StaticMotion

SIDE_PX, DEPTH = 32, 6.0
VIDEO = ("vae", "dit", "ldrm", "deformation")


@pytest.fixture(scope="module")
def tiny() -> Model:
    """Latents alone decide; random where a fresh network would be zero."""
    config = tiny_size()
    config = replace(config, dit=replace(config.dit, render_condition=True))
    model = Model(config=config, networks=create_networks(config, parts=VIDEO))
    generator = torch.Generator().manual_seed(5)
    for part in ("dit", "ldrm", "deformation"):
        for parameter in getattr(model.networks, part).parameters():
            if not bool(parameter.any()):
                parameter.data = 0.1 * torch.randn(parameter.shape, generator=generator)
    return model


@pytest.fixture(scope="module")
def refined() -> Model:
    """With key frames."""
    config = small_size()
    return Model(config=config, networks=create_networks(config, parts=VIDEO))


@torch.no_grad()
def filled(
    model: Model,
    step: float = 0.4,
    hidden_only: bool = True,
    text: torch.Tensor | None = None,
    **changes: object,
) -> tuple[VideoFill | None, RunLog]:
    image = input_image(random_rgb(SIDE_PX, SIDE_PX), 30.0)
    maps = ImageMaps(depth=torch.full((SIDE_PX, SIDE_PX), DEPTH), displacement=None)
    log = RunLog()
    path = sliding_path(image.camera, 5, (step, 0.0, 0.0))
    request = FillRequest(
        image=image,
        layered=build_layered_image(image, image, maps, 2),
        path=path,
        key_times_s=path.times_s,
        text=TextStates(prompt=text),
        seed=0,
        settings=replace(GenerationSettings(steps=1, static_threshold_px=0.0), **changes),
        hidden_only=hidden_only,
    )
    return fill_hidden(model, request, log), log


def test_only_cells_that_the_image_hides_are_filled(tiny: Model) -> None:
    fill, _ = filled(tiny)
    assert not fill.grid.filled[0].any()
    count = int(fill.grid.filled.sum())
    assert 0 < len(fill.gaussians.gaussians) <= count
    assert bool((fill.gaussians.pixel_index == NO_PIXEL).all())
    cameras = fill.grid.cameras
    pixels, z = project(cameras[0], fill.gaussians.gaussians.means)
    in_view = (z > 0) & (pixels >= 0).all(-1) & (pixels < SIDE_PX).all(-1)
    assert bool((z[in_view] >= 0.99 * DEPTH).all()), "nothing in front of the image"


def test_filled_cells_are_at_the_scale_of_the_image(refined: Model) -> None:
    fill, _ = filled(refined)
    z = fill.gaussians.gaussians.means[:, 2]
    assert len(z) > 0
    torch.testing.assert_close(z, torch.full_like(z, DEPTH), rtol=0.02, atol=0)
    assert fill.grid.cameras.batch_shape == (2,), "key frames"


@pytest.mark.parametrize("name", ["tiny", "refined"])
def test_a_camera_that_stays_has_nothing_to_fill(name: str, request: pytest.FixtureRequest) -> None:
    fill, log = filled(request.getfixturevalue(name), step=0.0)
    assert fill is None
    assert "sample video" not in log.phases.seconds


def test_without_geometry_of_the_image_every_cell_is_filled(tiny: Model) -> None:
    fill, _ = filled(tiny, hidden_only=False, min_opacity=0.0)
    cells = 5 * SIDE_PX**2
    assert bool(fill.grid.filled.all()) and len(fill.gaussians.gaussians) == cells
    wanted = [*range(SIDE_PX**2), *[NO_PIXEL] * (cells - SIDE_PX**2)]
    assert fill.gaussians.pixel_index.tolist() == wanted


def test_a_fill_may_be_too_faint_to_keep(tiny: Model) -> None:
    fill, log = filled(tiny, min_opacity=1.0)
    assert len(fill.gaussians.gaussians) == 0 and bool(fill.grid.filled.any())
    assert "faint Gaussians" in {omission.what for omission in log.skipped}


def test_a_fill_moves_unless_there_is_no_deformation(tiny: Model) -> None:
    assert len(filled(tiny)[0].gaussians.motion.moving_index) > 0
    still = replace(tiny, networks=replace(tiny.networks, deformation=None))
    assert isinstance(filled(still)[0].gaussians.motion, StaticMotion)


def test_the_render_condition_is_used(tiny: Model) -> None:
    embedding = tiny.networks.dit.condition_embedding.validity.weight
    before = filled(tiny)[0].gaussians.gaussians.means
    with torch.no_grad():
        embedding.mul_(-50.0)
        after = filled(tiny)[0].gaussians.gaussians.means
        embedding.div_(-50.0)
    assert before.shape != after.shape or not torch.equal(before, after)


def test_seeds_and_text_decide(tiny: Model) -> None:
    plain, log = filled(tiny)
    assert "no prompt" in {omission.why for omission in log.skipped}
    text = torch.randn(1, 4, tiny.config.text.width)
    prompted, log = filled(tiny, text=text)
    assert "no prompt" not in {omission.why for omission in log.skipped}
    left, right = (each.gaussians.gaussians.sh for each in (plain, prompted))
    assert left.shape != right.shape or not torch.equal(left, right)


def test_a_stride_fills_fewer_and_wider_cells(tiny: Model) -> None:
    fine, _ = filled(tiny, hidden_only=False, min_opacity=0.0)
    coarse, _ = filled(tiny, hidden_only=False, min_opacity=0.0, fill_stride=2)
    rows = fine.cell_index // SIDE_PX % SIDE_PX
    chosen = (rows % 2 == 0) & (fine.cell_index % SIDE_PX % 2 == 0)
    assert torch.equal(coarse.cell_index, fine.cell_index[chosen])
    torch.testing.assert_close(
        coarse.gaussians.gaussians.scales, 2 * fine.gaussians.gaussians.scales[chosen]
    )
    assert torch.equal(coarse.grid.filled, fine.grid.filled), "guesses are hidden as before"
