"""Objects of one image put on another: pixels, masks, and what they cover."""

import torch

from diff4splat.captions.grammar import NamedObject
from diff4splat.training.batches.requests.object_image import ObjectImage
from diff4splat.training.batches.requests.paste import paste
from diff4splat.training.batches.requests.present import PresentObject

SIDE = 48
RED, BLUE = (torch.tensor(one, dtype=torch.uint8) for one in ([200, 0, 0], [0, 0, 200]))


def object_image(rows: slice, columns: slice, color: torch.Tensor, name: str) -> ObjectImage:
    mask = torch.zeros(SIDE, SIDE, dtype=torch.bool)
    mask[rows, columns] = True
    image = torch.full((SIDE, SIDE, 3), 90, dtype=torch.uint8)
    image[mask] = color
    one = PresentObject(named=NamedObject(name, "box"), mask=mask, moves=True)
    return ObjectImage(image=image, objects=[one])


def random(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_the_pasted_object_is_whole_and_in_front() -> None:
    below = object_image(slice(0, SIDE), slice(0, SIDE), RED, "red")
    above = object_image(slice(10, 26), slice(20, 30), BLUE, "blue")
    places = set()
    for seed in range(30):
        found = paste(below, above, random(seed))
        first, pasted = found.objects
        assert (first.named.color, pasted.named.color) == ("red", "blue")
        assert first.moves and not pasted.moves
        assert torch.equal(first.mask, ~pasted.mask)
        area = int(pasted.mask.sum())
        assert 0.5 * 0.6**2 * 160 < area < 1.5 * 1.6**2 * 160
        blue = (found.image[pasted.mask].int() - BLUE.int()).abs().amax(-1) < 60
        assert float(blue.double().mean()) > 0.6
        assert torch.equal(found.image[first.mask], below.image[first.mask])
        places.add(int(pasted.mask.nonzero()[:, 1].double().mean()))
    assert len(places) > 8


def test_objects_that_are_cut_stay_where_they_are() -> None:
    below = object_image(slice(4, 20), slice(4, 20), RED, "red")
    cut = object_image(slice(0, 12), slice(20, 30), BLUE, "blue")
    assert paste(below, cut, random(0)) is below
    assert paste(below, ObjectImage(image=cut.image, objects=[]), random(0)) is below


def test_covered_objects_go() -> None:
    dot = object_image(slice(20, 21), slice(20, 22), RED, "red")
    block = object_image(slice(4, 34), slice(4, 34), BLUE, "blue")
    counts = {len(paste(dot, block, random(seed)).objects) for seed in range(30)}
    assert counts == {1, 2}
