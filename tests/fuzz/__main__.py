"""Damaged files for every reader: ``make fuzz``, or ``python -m fuzz --reader ply --count 500``.

    ok        read as if nothing had happened, which is fine for most damage
    refused   with an error of diff4splat
    foreign   any other exception, or a crash
    hang      more than 10 seconds of processor time, or no answer for a minute
    memory    more than 2 GB at once

The exit status is 1 if one of the last three occurs. The same seed draws the same damage.
"""

import argparse
import sys

from fuzz.campaign import Campaign, Failure, Tally
from fuzz.outcome import FAILURES, OK, REFUSED
from fuzz.readers import READERS

COLUMNS = (OK, REFUSED, *FAILURES)


def main() -> int:
    """Print a table, and on stderr every failure with what is needed to see it again."""
    arguments = _parser().parse_args()
    readers = arguments.reader or list(READERS)
    print(f"seed {arguments.seed}\n\n| reader | cases | {' | '.join(COLUMNS)} |")
    print("|---|--:|" + "--:|" * len(COLUMNS), flush=True)
    failed = False
    with Campaign(arguments.seed) as campaign:
        for reader in readers:
            tally = campaign.run(reader, range(arguments.first, arguments.first + arguments.count))
            print(_row(reader, tally), flush=True)
            for failure in tally.failures.values():
                print(_described(reader, failure), file=sys.stderr, flush=True)
            failed |= bool(tally.failures)
    return int(failed)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__.split("\n", 1)[0])
    parser.add_argument("--count", type=int, default=10_000, help="cases per reader")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--reader", action="append", choices=list(READERS), metavar="NAME")
    return parser


def _row(reader: str, tally: Tally) -> str:
    counts = [f"{tally.counts[column]:,}" for column in COLUMNS]
    return f"| {reader} | {tally.counts.total():,} | {' | '.join(counts)} |"


def _described(reader: str, failure: Failure) -> str:
    outcome = failure.outcome
    edits = "".join(f"\n    {edit}" for edit in failure.edits)
    return (
        f"{reader}: {failure.count} × {outcome.kind} {outcome.where} {outcome.message}\n"
        f"  --reader '{reader}' --first {failure.index} --count 1{edits}"
    )


if __name__ == "__main__":
    sys.exit(main())
