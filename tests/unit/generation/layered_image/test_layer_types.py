"""A layer refuses maps that are not on its grid."""

import pytest
import torch
from image_layers import layer, layered

from diff4splat.errors import ShapeError


@pytest.mark.usefixtures("as_shipped")
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rgb", torch.zeros(4, 5, 3)),
        ("mask", torch.ones(5, 6, dtype=torch.bool)),
        ("displacement", torch.zeros(2, 6, 4, 3)),
        ("pixel_index", torch.zeros(4, 7, dtype=torch.int64)),
    ],
)
def test_maps_off_the_grid_are_refused(name: str, value: torch.Tensor) -> None:
    with pytest.raises(ShapeError, match=rf"ImageLayer\.{name}: expected the grid \(4, 6\)"):
        layer(torch.ones(4, 6), **{name: value})


def test_cells_of_the_image_are_counted_by_their_masks() -> None:
    mask = torch.zeros(4, 6, dtype=torch.bool)
    mask[1, 2:5] = True
    shown = layer(torch.ones(4, 6), mask=mask, in_image=True)
    image = layered(shown, layer(torch.ones(2, 3), in_image=True), layer(torch.ones(9, 9)))
    assert image.visible_count == 3 + 6
