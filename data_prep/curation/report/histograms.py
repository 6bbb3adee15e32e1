"""Histograms of scores as SVG, with the gates as lines. A score's long tail is cut at its ends."""

import math
from html import escape

import numpy as np

from diff4splat.data_prep.curation.decisions import Decision
from diff4splat.data_prep.curation.thresholds import Gate

_BINS = 32
_WIDTH, _HEIGHT, _BASE = 256, 96, 80
_TAILS = (0.5, 99.5)
"""Percentiles; single values far out would squeeze all others into one bar."""


def histogram_svg(values: list[float], gates: list[Gate]) -> str:
    """Bars, in the colour of rejection where most values fail a gate, and one line per limit."""
    low, high = _span(values, gates)
    counts, _ = np.histogram(np.clip(values, low, high), _BINS, (low, high))
    tallest = max(int(counts.max()), 1)
    passing = [value for value in values if _passes(value, gates)]
    passed, _ = np.histogram(np.clip(passing, low, high), _BINS, (low, high))
    bars = "".join(
        _bar(number, int(count), tallest, bool(2 * passed[number] >= count))
        for number, count in enumerate(counts)
        if count
    )
    limits = {limit for gate in gates for limit in (gate.least, gate.most) if limit is not None}
    lines = "".join(_line(limit, low, high) for limit in sorted(limits))
    axis = f'<line class="axis" x1="0" x2="{_WIDTH}" y1="{_BASE}" y2="{_BASE}"/>'
    words = (
        f'<text x="0" y="{_HEIGHT - 4}">{_number(low)}</text>'
        f'<text x="{_WIDTH}" y="{_HEIGHT - 4}" text-anchor="end">{_number(high)}</text>'
    )
    label = escape(f"{len(values)} values from {_number(low)} to {_number(high)}")
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" role="img" '
        f'aria-label="{label}">{axis}{bars}{lines}{words}</svg>'
    )


def values_of(decisions: list[Decision], score: str) -> list[float]:
    """The score of every clip that has it."""
    return [d.record.scores[score] for d in decisions if score in d.record.scores]


def _span(values: list[float], gates: list[Gate]) -> tuple[float, float]:
    low, high = (float(v) for v in np.percentile(values, _TAILS))
    limits = [limit for gate in gates for limit in (gate.least, gate.most) if limit is not None]
    low, high = min([low, *limits]), max([high, *limits])
    return (low, high) if high > low else (low - 0.5, low + 0.5)


def _passes(value: float, gates: list[Gate]) -> bool:
    return all(
        (gate.least is None or value >= gate.least) and (gate.most is None or value <= gate.most)
        for gate in gates
    )


def _bar(number: int, count: int, tallest: int, passes: bool) -> str:
    width = _WIDTH / _BINS
    # A single clip among thousands must still be visible.
    height = max(2.0, count / tallest * (_BASE - 4))
    kind = "pass" if passes else "fail"
    return (
        f'<rect class="{kind}" x="{number * width:.1f}" y="{_BASE - height:.1f}" '
        f'width="{width - 1:.1f}" height="{height:.1f}"><title>{count}</title></rect>'
    )


def _line(limit: float, low: float, high: float) -> str:
    x = (limit - low) / (high - low) * _WIDTH
    return f'<line class="gate" x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{_BASE}"/>'


def _number(value: float) -> str:
    if value and (abs(value) >= 10_000 or abs(value) < 0.001):
        return f"{value:.1e}"
    digits = 0 if not value else max(0, 2 - math.floor(math.log10(abs(value))))
    text = f"{value:.{min(digits, 5)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
