"""The photograph at the model's size: shape, crop, focal length."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from diff4splat.errors import ConfigError, InputError
from diff4splat.generation.inputs.input_image import (
    FocalChoice,
    choose_focal,
    model_size,
    prepare_image,
)
from diff4splat.geometry.camera import focal_from_35mm, focal_from_fov, pinhole
from diff4splat.geometry.rays import camera_rays


@given(st.integers(16, 4000), st.integers(16, 4000), st.sampled_from([128, 256, 512]))
@settings(max_examples=50, deadline=None)
def test_model_size_fits_the_budget_and_keeps_the_shape(height: int, width: int, side: int) -> None:
    if not 1 / 4 < width / height < 4:
        return
    h, w = model_size((height, width), side)
    assert h % 16 == w % 16 == 0
    assert h * w <= side * side
    assert h * w > 0.5 * side * side
    assert abs(w / h / (width / height) - 1) < 16 / min(h, w)


def test_square_and_common_shapes() -> None:
    assert model_size((512, 512), 256) == (256, 256)
    assert model_size((4000, 6000), 256) == (208, 304)
    assert model_size((6000, 4000), 256) == (304, 208)


def test_a_thread_of_pixels_is_refused() -> None:
    with pytest.raises(InputError, match="crop it"):
        model_size((16, 16000), 256)
    with pytest.raises(ConfigError, match="16 to 1024"):
        model_size((100, 100), 8)


def test_focal_is_the_asked_one_then_exif_then_a_default() -> None:
    size = (300, 400)
    asked = choose_focal(size, 60.0, 28.0)
    assert asked.focal_px == pytest.approx(focal_from_fov(60.0, 400))
    assert "--fov 60" in asked.source
    from_exif = choose_focal(size, None, 28.0)
    assert from_exif.focal_px == pytest.approx(focal_from_35mm(28.0, size))
    assert "EXIF" in from_exif.source
    assert "default" in choose_focal(size, None, None).source


@pytest.mark.parametrize("fov_deg", [0.0, -5.0, 175.0, float("nan")])
def test_impossible_fields_of_view_are_refused(fov_deg: float) -> None:
    with pytest.raises(ConfigError, match="1 to 170 degrees"):
        choose_focal((300, 400), fov_deg, None)


@pytest.mark.parametrize("shape", [(300, 500), (300, 560), (520, 300)])
def test_pixels_keep_their_rays_through_crop_and_resize(
    shape: tuple[int, int],
) -> None:
    """An image whose colours are its own ray directions still shows them after crop and resize."""
    size, focal = shape, 400.0
    directions = camera_rays(pinhole(focal, size))[..., :2]
    rgb = torch.cat([directions / 2 + 0.5, torch.zeros(*size, 1)], -1)
    image = prepare_image(rgb, FocalChoice(focal_px=focal, source="test"), 128)
    seen = (image.rgb[..., :2] - 0.5) * 2
    expected = camera_rays(image.camera)[..., :2]
    torch.testing.assert_close(seen[2:-2, 2:-2], expected[2:-2, 2:-2], atol=2e-3, rtol=0)
    across, along = image.camera.focal_px.tolist()
    assert across == pytest.approx(along, rel=0.01), "pixels stay square"


def test_enlarging_stays_in_range_and_the_right_size_is_left_alone() -> None:
    small = torch.rand(20, 20, 3).round()
    focal = FocalChoice(focal_px=20.0, source="test")
    enlarged = prepare_image(small, focal, 64)
    assert enlarged.rgb.shape == (64, 64, 3)
    assert float(enlarged.rgb.min()) >= 0
    assert float(enlarged.rgb.max()) <= 1
    exact = torch.rand(64, 64, 3)
    torch.testing.assert_close(prepare_image(exact, focal, 64).rgb, exact, rtol=0, atol=0)


def test_a_crop_is_announced_and_a_whole_image_is_not() -> None:
    focal = choose_focal((300, 451), None, None)
    notes = prepare_image(torch.rand(300, 451, 3), focal, 256, 64).notes
    assert len(notes) == 1 and notes[0].startswith("cropped by ") and "320×192" in notes[0]
    assert prepare_image(torch.rand(64, 64, 3), focal, 64, 16).notes == ()


@given(st.integers(20, 90), st.integers(20, 90), st.sampled_from([32, 48]))
@settings(max_examples=30)
def test_padding_keeps_every_pixel_and_the_lens(height: int, width: int, side: int) -> None:
    if not 0.4 < height / width < 2.5:
        return
    focal = FocalChoice(focal_px=60.0, source="test")
    image = prepare_image(torch.rand(height, width, 3), focal, side, fit="pad")
    corners = torch.tensor([[0.0, 0.0], [width, height]]) - torch.tensor([width / 2, height / 2])
    # Where the corners of the photograph fall, by the camera of the padded image.
    shown = corners / focal.focal_px * image.camera.focal_px + image.camera.center_px
    size = torch.tensor([image.camera.size_px[1], image.camera.size_px[0]])
    assert bool((shown >= -0.6).all())
    assert bool((shown <= size + 0.6).all())
    touches = (shown[0] < 0.6) & (shown[1] > size - 0.6)
    assert bool(touches.any()), "no more is added than needed"


def test_padding_continues_the_edge_and_says_so() -> None:
    rgb = torch.full((60, 130, 3), 0.25)
    rgb[0], rgb[-1] = 0.75, 1.0
    focal = FocalChoice(focal_px=80.0, source="test")
    image = prepare_image(rgb, focal, 64, 16, "pad")
    assert image.notes[0].startswith("padded by ")
    assert "with the colours of the edge" in image.notes[0]
    cropped = prepare_image(rgb, focal, 64, 16)
    assert cropped.notes[0].endswith("; --fit pad keeps everything")
    assert cropped.rgb.shape == image.rgb.shape
    assert float(image.camera.focal_px[0]) < float(cropped.camera.focal_px[0])
