"""Every adapter that can run here draws the tiny scene as the truth has it."""

import importlib.util
import types
from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch
from adapter import Adapter, judged, note, refusal
from ground_truth.comparison import gradient_errors, image_error
from ground_truth.pixel_samples import find_truth
from loading import BUILT_IN, find_peers, load
from scenes import TINY

from diff4splat.errors import ConfigError, InputError

IN_PYTORCH = ["reference", "raster", "tile_loop", "gsplat_torch"]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("degree", [0, 3])
@pytest.mark.parametrize("name", IN_PYTORCH)
def test_picture_and_gradients_are_true(name: str, degree: int) -> None:
    adapter = load(BUILT_IN / f"{name}.py")
    if (reason := adapter.unavailable()) is not None:
        pytest.skip(reason)
    gaussians, camera = TINY[degree].build()
    truth = find_truth(TINY[degree])
    prepared = adapter.prepare(gaussians, camera)
    picture = prepared.forward()
    assert picture.dtype == torch.float32
    assert not picture.requires_grad
    assert image_error(picture, truth).psnr_db > (60 if name == "tile_loop" else 90)
    found = prepared.forward_backward(truth.grad_rgb(camera.size_px))
    for error in gradient_errors(found, truth.gradients):
        assert error.relative_l2 < 1e-2, error


@pytest.mark.parametrize("file", sorted(BUILT_IN.glob("*.py")), ids=lambda file: file.stem)
def test_built_in_adapters_keep_the_contract(file: Path) -> None:
    adapter = load(file)
    assert isinstance(adapter, Adapter)
    assert adapter.NAME
    reason = adapter.unavailable()
    assert reason is None or "\n" not in reason
    assert "\n" not in note(adapter)
    assert isinstance(judged(adapter), bool)


def test_ours_come_first() -> None:
    names = [peer.name for peer in find_peers([], [])]
    assert names[:2] == ["raster", "reference"]
    assert [peer.name for peer in find_peers([], ["tile-loop", "reference"])] == [
        "tile-loop",
        "reference",
    ]


def test_a_plugin_is_one_more_renderer(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        'NAME = "mine"\nunavailable = lambda: "needs luck"\nprepare = lambda gaussians, camera: 0\n'
    )
    mine = find_peers([tmp_path], [])[-1]
    assert (mine.name, mine.unavailable) == ("mine", "needs luck")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import a_module_that_is_missing", "fails to load: No module named"),
        ('NAME = "half"', "expected NAME, unavailable and prepare"),
        ("def broken(:", "fails to load"),
    ],
)
def test_a_broken_plugin_is_a_line_in_the_table(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "bad.py").write_text(text)
    with pytest.raises(InputError, match=reason):
        load(tmp_path / "bad.py")
    bad = find_peers([tmp_path], [])[-1]
    assert bad.name == "bad"
    assert reason in bad.unavailable
    assert "\n" not in bad.unavailable


def test_what_is_unknown_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--peers: expected names among raster.*got nobody"):
        find_peers([], ["nobody"])
    with pytest.raises(ConfigError, match="--plugins: expected a folder"):
        find_peers([tmp_path / "none"], [])


def test_optional_names_have_defaults() -> None:
    bare = types.SimpleNamespace(NAME="bare")
    assert (note(bare), judged(bare), refusal(bare, TINY[0])) == ("", True, None)
    full = types.SimpleNamespace(NOTE="x", JUDGED=False, refuses=lambda scene: scene.name)
    assert (note(full), judged(full), refusal(full, TINY[0])) == ("x", False, "tiny")


def test_packed_weights_are_products_along_each_pixel() -> None:
    gsplat_torch = load(BUILT_IN / "gsplat_torch.py")
    alpha = torch.tensor([0.5, 0.25, 0.9, 0.1, 0.2, 0.3])
    rays = torch.tensor([2, 2, 2, 5, 7, 7])
    weights, light = gsplat_torch.weights_from_alpha(alpha, ray_indices=rays, n_rays=9)
    want = torch.tensor([1.0, 0.5, 0.375, 1.0, 1.0, 0.8])
    torch.testing.assert_close(light, want)
    torch.testing.assert_close(weights, alpha * want)
    sums = gsplat_torch.sums_along_rays(weights, None, ray_indices=rays, n_rays=9)
    torch.testing.assert_close(sums[2, 0], (alpha * want)[:3].sum())
    assert sums.shape == (9, 1)
    assert not sums[[0, 1, 3, 4, 6, 8]].any()


def test_vectorised_tile_lists_are_those_of_gsplat() -> None:
    if importlib.util.find_spec("gsplat") is None:
        pytest.skip("needs gsplat")
    from gsplat.cuda._torch_impl import _isect_offset_encode, _isect_tiles

    lists = load(BUILT_IN / "gsplat_torch.py").tile_lists
    means = torch.rand(40, 2) * torch.tensor([80.0, 50.0]) - 10
    radii, depths = torch.randint(0, 20, (40, 2)), torch.rand(40) + 1
    offsets, members = lists(means, radii, depths, (40, 60))
    _, keys, want = _isect_tiles(means[None], radii[None].int(), depths[None], 16, 4, 3)
    assert torch.equal(members, want.long())
    assert torch.equal(offsets, _isect_offset_encode(keys, 1, 4, 3).long())


def test_tables_of_mitsuba_add_the_dilation_and_turn_quaternions() -> None:
    tables = load(BUILT_IN / "mitsuba_ellipsoids.py").tables
    gaussians, camera = TINY[0].build()
    data, opacities, colors = tables(gaussians, camera)
    footprint = (data[:, 3:6] ** 2 - gaussians.scales**2).sqrt()
    pixels = footprint * camera.focal_px[0] / gaussians.means[:, 2:]
    torch.testing.assert_close(pixels, torch.full_like(pixels, 0.3**0.5), rtol=1e-3, atol=0.0)
    unit = torch.nn.functional.normalize(gaussians.quats, dim=-1)
    torch.testing.assert_close(data[:, 6:], unit[:, [1, 2, 3, 0]])
    assert (opacities.shape, colors.shape) == ((50, 1), (50, 3))
    still = replace(gaussians, scales=torch.zeros_like(gaussians.scales))
    assert all(torch.isfinite(part).all() for part in tables(still, camera))
    assert {field.name for field in fields(still)} == {
        "means",
        "quats",
        "scales",
        "opacities",
        "sh",
    }
