"""Run checks one by one; an error of one is its row and does not end the report."""

import itertools
import time
from collections.abc import Sequence

import torch

from diff4splat.errors import Diff4SplatError
from diff4splat.progress.interrupts import raise_if_stopped
from diff4splat.progress.phases import Phases
from diff4splat.stability.check import Check, NotRunError, Outcome, Record, Verdict, violations

SEED = 0


def run_checks(checks: Sequence[Check], phases: Phases) -> list[Record]:
    """Records in the order of ``checks``, with one phase per run of equal groups."""
    records = []
    for group, members in itertools.groupby(checks, key=lambda check: check.group):
        of_group = list(members)
        with phases.phase(group, len(of_group)) as advance:
            for check in of_group:
                records.append(run_check(check))
                advance()
    return records


def run_check(check: Check) -> Record:
    """Run one check; every ``Exception`` becomes a verdict."""
    start = time.perf_counter()
    # Neither order nor choice of the checks may change a result.
    torch.manual_seed(SEED)
    verdict, outcome, message = _verdict(check)
    raise_if_stopped()
    return Record(
        check=check,
        verdict=verdict,
        seconds=time.perf_counter() - start,
        outcome=outcome,
        message=message,
    )


def _verdict(check: Check) -> tuple[Verdict, Outcome | None, str]:
    try:
        outcome = check.run()
    except NotRunError as error:
        return "not run", None, str(error)
    except Diff4SplatError as error:
        return "refused", None, str(error)
    except Exception as error:
        return "fails", None, f"{type(error).__name__}: {error}"
    broken = violations(check, outcome)
    return ("fails" if broken else "ok"), outcome, "; ".join(broken)
