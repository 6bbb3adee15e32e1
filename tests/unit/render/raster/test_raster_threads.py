"""Parts are done once each, on threads, and errors come back when all is quiet."""

import threading
import time

import pytest
import torch

from diff4splat.render.raster.threads import ranges, spread


@pytest.fixture(params=[1, 3], autouse=True)
def _threads(request: pytest.FixtureRequest):
    before = torch.get_num_threads()
    torch.set_num_threads(request.param)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("count", [0, 1, 2, 50])
def test_every_part_is_done_once(count: int) -> None:
    done, lock = [], threading.Lock()

    def work(number: int, double: int) -> None:
        with lock:
            done.append((number, double))

    spread(work, ((number, 2 * number) for number in range(count)))
    assert sorted(done) == [(number, 2 * number) for number in range(count)]


def test_an_error_comes_back_when_nobody_works_any_more() -> None:
    working, begun = set(), []

    def work(number: int) -> None:
        working.add(number)
        begun.append(number)
        try:
            if number == 0:
                time.sleep(0.02)
                raise ValueError("part 0")
            time.sleep(0.1)
        finally:
            working.discard(number)

    with pytest.raises(ValueError, match="part 0"):
        spread(work, ((number,) for number in range(100)))
    assert not working
    assert len(begun) < 10, "the parts that nobody had begun are left out"


def test_ranges_cover_everything_once() -> None:
    assert ranges(10, 4) == [(0, 4), (4, 8), (8, 10)]
    assert ranges(0, 4) == []
