"""Depth networks run: input size, normalisation, outputs, and answers that are no depth."""

from pathlib import Path

import numpy as np
import pytest
import small_onnx
import torch

from diff4splat.errors import FileFormatError
from diff4splat.models.depth_priors.contracts import IMAGENET, DepthContract
from diff4splat.models.depth_priors.graph_facts import TensorFacts
from diff4splat.models.depth_priors.onnx_prior import OnnxDepthPrior
from diff4splat.models.depth_priors.point_maps import point_map_depth
from diff4splat.models.depth_priors.preprocessing import input_size, network_input

RGB = torch.rand(40, 60, 3, generator=torch.Generator().manual_seed(0))
FOCAL = (50.0, 50.0)
IMAGE = TensorFacts(name="pixel_values", dtype="float32", shape=(1, 3, None, None))
CONTRACT = DepthContract(family="a", input="x", output="y", kind="inverse")


@pytest.mark.parametrize(
    ("size_px", "expected"),
    [
        ((480, 640), (518, 686)),
        ((640, 480), (686, 518)),
        ((256, 256), (518, 518)),
        ((60, 84), (364, 518)),
        ((1080, 1920), (518, 924)),
    ],
)
def test_the_shape_is_kept_in_whole_patches(
    size_px: tuple[int, int], expected: tuple[int, int]
) -> None:
    assert input_size(CONTRACT, IMAGE, size_px) == expected


def test_sides_that_the_graph_fixes_are_taken() -> None:
    fixed = TensorFacts(name="x", dtype="float32", shape=(1, 3, 256, None))
    assert input_size(CONTRACT, fixed, (100, 100)) == (256, 518)
    huge = TensorFacts(name="x", dtype="float32", shape=(1, 3, 1 << 20, 1 << 20))
    with pytest.raises(FileFormatError, match="at most 4096 pixels"):
        input_size(CONTRACT, huge, (100, 100))


def test_colours_are_rgb_and_normalised() -> None:
    contract = DepthContract(
        family="a", input="x", output="y", kind="inverse", mean=IMAGENET[0], std=IMAGENET[1]
    )
    red = torch.zeros(28, 28, 3)
    red[..., 0] = 1
    pixels = network_input(contract, IMAGE, red)[0]
    expected = [(value - m) / s for value, m, s in zip((1, 0, 0), *IMAGENET, strict=True)]
    torch.testing.assert_close(pixels.mean((1, 2)), torch.tensor(expected))


def test_views_and_half_precision_follow_the_graph() -> None:
    views = TensorFacts(name="x", dtype="float16", shape=(1, None, 3, None, None))
    pixels = network_input(CONTRACT, views, RGB)
    assert pixels.ndim == 5 and pixels.dtype == torch.float16


def test_a_graph_runs_on_an_image_of_any_size(tmp_path: Path) -> None:
    prior = OnnxDepthPrior(small_onnx.one_map(tmp_path / "a.onnx"))
    for shape in ((40, 60), (90, 30)):
        found = prior.predict(torch.full((*shape, 3), 0.7), FOCAL)
        mean = np.mean([(0.7 - m) / s for m, s in zip(*IMAGENET, strict=True)])
        np.testing.assert_allclose(found.values, mean, atol=1e-5)
        assert max(found.values.shape) == 37 and found.kind == "inverse"


def test_a_kind_that_is_asked_for_wins(tmp_path: Path) -> None:
    prior = OnnxDepthPrior(small_onnx.one_map(tmp_path / "a.onnx"), "metric")
    assert prior.predict(RGB, FOCAL).kind == "metric"


def test_external_weights_beside_the_graph_are_read(tmp_path: Path) -> None:
    count = 3 * 14 * 14 * 4
    (tmp_path / "a.data").write_bytes(np.full(count // 4, 0.5, np.float32).tobytes())
    prior = OnnxDepthPrior(small_onnx.with_external_weights(tmp_path / "a.onnx", "a.data", count))
    plain = OnnxDepthPrior(small_onnx.one_map(tmp_path / "b.onnx"))
    found, expected = (one.predict(RGB, FOCAL).values for one in (prior, plain))
    np.testing.assert_allclose(found, expected * 0.5 * 3 * 14 * 14, rtol=1e-4, atol=1e-3)
    assert prior.sha256() != plain.sha256()


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (np.full((1, 4, 4), np.nan), "NaN or infinity in 16 of 16"),
        (np.full((1, 4, 4), np.inf), "NaN or infinity"),
        (np.zeros((1, 0, 0)), r"the shape \[1, 0, 0\]"),
        (np.zeros((2, 4, 4)), "expected one map of depth"),
        (np.zeros(4), "expected a map of depth"),
    ],
)
def test_answers_that_are_no_depth_are_refused(
    tmp_path: Path, answer: np.ndarray, reason: str
) -> None:
    prior = OnnxDepthPrior(small_onnx.constant(tmp_path / "a.onnx", answer))
    with pytest.raises(FileFormatError, match=reason):
        prior.predict(RGB, FOCAL)


def test_a_cut_off_graph_is_refused(tmp_path: Path) -> None:
    file = small_onnx.one_map(tmp_path / "a.onnx")
    file.write_bytes(file.read_bytes()[:-3])
    with pytest.raises(FileFormatError, match=r"a\.onnx"):
        OnnxDepthPrior(file).predict(RGB, FOCAL)


def test_moge_finds_the_offset_of_z_by_the_focal_length(tmp_path: Path) -> None:
    size, focal = (30, 42), 40.0
    columns, rows = np.meshgrid(np.arange(size[1]) + 0.5, np.arange(size[0]) + 0.5)
    z = 3 + np.sin(columns / 5) + rows / 30
    x, y = (columns - size[1] / 2) * z / focal, (rows - size[0] / 2) * z / focal
    points = np.stack([x, y, z - 1.7], -1)
    mask = np.ones(size)
    mask[:5] = 0
    points[7, 7] = (3, -5, 100)  # one wrong point
    prior = OnnxDepthPrior(small_onnx.moge(tmp_path / "a.onnx", points, mask, 2.5))
    # The map covers an image of 60 by 84 px: twice the focal length.
    found = point_map_depth(points, mask > 0.5, (focal, focal))
    assert np.isnan(found[:5]).all()
    np.testing.assert_allclose(np.delete(found[5:].ravel(), 2 * size[1] + 7),
                               np.delete(z[5:].ravel(), 2 * size[1] + 7), rtol=1e-3)  # fmt: skip
    assert prior.contract.family == "MoGe" and prior.kind == "metric"
