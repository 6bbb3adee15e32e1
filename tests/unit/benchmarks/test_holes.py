"""Holes lie in the image, and what is filled with the truth has no distance to it."""

import torch
from image_layers import box_mask, input_image
from torch import Tensor

from benchmarks.photograph_sheet.holes import Hole, measured, row

SIDE = 48


def _hole() -> Hole:
    rgb = 0.35 + 0.3 * torch.rand(SIDE, SIDE, 3, generator=torch.Generator().manual_seed(0))
    return Hole(picture=input_image(rgb), known=~box_mask())


def test_the_truth_has_all_of_its_detail_and_a_mean_has_none() -> None:
    hole = _hole()

    def truth(rgb: Tensor, known: Tensor) -> Tensor:
        return rgb + 1e-6 * ~known[..., None]

    def mean(rgb: Tensor, known: Tensor) -> Tensor:
        return torch.where(known[..., None], rgb, rgb[known].mean(0))

    found = measured({"network": truth, "mean": mean}, [hole])
    _, distance, detail, as_drawn, sharp = found["network"][0].tolist()
    assert distance < 1e-4 and abs(detail - 1) < 1e-3 and as_drawn < 0.95 < sharp + 0.05
    assert found["mean"][0, 2] < 1e-6 and found["mean"][0, 1] > 0.01
    assert "| 0.00 |" in row(found["mean"], found["network"])


def test_the_window_holds_the_hole_and_a_margin() -> None:
    rows, columns = _hole().window
    assert (rows.start, rows.stop, columns.start, columns.stop) == (10, 38, 6, 38)
