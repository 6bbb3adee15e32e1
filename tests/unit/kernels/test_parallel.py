"""Parts are done once each, on threads, and errors come back when all is quiet."""

import threading
import time

import pytest
import torch

from diff4splat.kernels.parallel import parallel_for, ranges


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

    parallel_for(work, ((number, 2 * number) for number in range(count)))
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
        parallel_for(work, ((number,) for number in range(100)))
    assert not working
    # Without the error it would be all of them; how many less depends on the load of the machine.
    assert len(begun) < 100


def test_an_error_of_a_helper_ends_the_work_of_the_caller_too() -> None:
    caller, begun, helped = threading.current_thread(), [], threading.Event()

    def work(number: int) -> None:
        begun.append(number)
        if threading.current_thread() is not caller or torch.get_num_threads() == 1:
            helped.set()
            raise ValueError("a helper")
        helped.wait(60)
        time.sleep(0.05)

    with pytest.raises(ValueError, match="a helper"):
        parallel_for(work, ((number,) for number in range(100)))
    assert len(begun) < 20
    done = []
    parallel_for(done.append, ((number,) for number in range(20)))
    assert sorted(done) == list(range(20))


def test_the_caller_works_and_all_threads_help() -> None:
    count = torch.get_num_threads()
    meeting, seen = threading.Barrier(count, timeout=60), set()

    def work(_: int) -> None:
        meeting.wait()
        seen.add(threading.current_thread())

    parallel_for(work, ((number,) for number in range(count)))
    assert len(seen) == count
    assert threading.current_thread() in seen


def test_two_callers_at_once() -> None:
    done = [[], []]

    def call(own: list[int]) -> None:
        for _ in range(20):
            parallel_for(own.append, ((number,) for number in range(10)))

    callers = [threading.Thread(target=call, args=(own,)) for own in done]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join(timeout=120)
        assert not caller.is_alive()
    assert all(sorted(own) == sorted(list(range(10)) * 20) for own in done)


def test_no_more_threads_are_started_than_are_allowed() -> None:
    torch.set_num_threads(7)
    before = threading.active_count()
    for count in range(2, 20):
        parallel_for(lambda _: time.sleep(1e-3), ((number,) for number in range(count)))
    assert threading.active_count() - before <= 6


def test_ranges_cover_everything_once() -> None:
    assert ranges(10, 4) == [(0, 4), (4, 8), (8, 10)]
    assert ranges(0, 4) == []
