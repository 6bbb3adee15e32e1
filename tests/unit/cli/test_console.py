"""Progress bars: the time that remains, by a clock of the test."""

from rich.progress import Progress

from diff4splat.cli.common.console import RemainingColumn


def test_the_time_that_remains() -> None:
    clock = iter(range(0, 1000, 10))
    now_s = [0]
    progress, column = Progress(get_time=lambda: now_s[0]), RemainingColumn()
    bar, shown = progress.add_task("render", total=4), []
    for _ in range(4):
        now_s[0] = next(clock)
        shown.append(column.render(progress.tasks[bar]).plain)
        progress.advance(bar)
    assert shown == ["", "", "0:00:20 left", "0:00:10 left"]
    assert column.render(progress.tasks[bar]).plain == "", "nothing remains"
