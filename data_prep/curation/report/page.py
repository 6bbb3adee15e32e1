"""The report: counts, histograms and rejected clips with their reason, in one HTML file.

Nothing is loaded from elsewhere, no script runs, and every text from a data set is escaped.
"""

from collections.abc import Iterator
from html import escape
from importlib import resources
from pathlib import Path

from diff4splat.data_prep.curation.decisions import ORDER, Decision
from diff4splat.data_prep.curation.report.counts import (
    StageCount,
    by_dataset,
    by_reason,
    stage_counts,
)
from diff4splat.data_prep.curation.report.histograms import histogram_svg, values_of
from diff4splat.data_prep.curation.report.thumbnails import Thumbnails
from diff4splat.data_prep.curation.thresholds import Thresholds
from diff4splat.io.atomic import write_text
from diff4splat.progress.phases import Phases

FILE_NAME = "report.html"
EXAMPLES_PER_REASON = 20
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_WORDS = {
    "reading": "the clip can be read",
    "integrity": "shapes, poses, lens",
    "cuts": "shot cuts, fades, duration",
    "exposure": "brightness, borders, text, sharpness",
    "motion": "optical flow",
    "camera": "camera path",
    "depth": "depth and its alignment",
    "geometry": "depth, flow and cameras against each other",
    "dynamic": "what moves by itself",
    "tracks": "reliable and moving tracks",
    "quality": "quality model",
    "duplicates": "clips that look alike",
    "balance": "quotas",
}


def write_report(
    decisions: list[Decision],
    thresholds: Thresholds,
    folders: tuple[Path, ...],
    out: Path,
    phases: Phases,
) -> Path:
    """Write ``report.html``; returns its path.

    Raises:
        OutputError: it cannot be written.
    """
    groups = by_reason(decisions)
    wanted = sum(min(len(group), EXAMPLES_PER_REASON) for group in groups.values())
    thumbnails, images = Thumbnails(folders), {}
    with phases.phase("draw report", wanted) as advance:
        for group in groups.values():
            for decision in _spread(group):
                images[decision.record.key] = thumbnails.address(decision.record)
                advance()
    file = out / FILE_NAME
    write_text(file, page(decisions, thresholds, images))
    return file


def page(
    decisions: list[Decision],
    thresholds: Thresholds,
    images: dict[tuple[str, str], str | None],
) -> str:
    """The page as text; ``images`` are data addresses by folder and identifier."""
    style = resources.files("diff4splat.data_prep.curation.report") / "style.css"
    body = "".join(_sections(decisions, thresholds, images))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>Curation report</title><style>{style.read_text(encoding='utf-8')}</style></head>"
        f"<body><main>{body}</main></body></html>\n"
    )


def _sections(
    decisions: list[Decision], thresholds: Thresholds, images: dict[tuple[str, str], str | None]
) -> Iterator[str]:
    yield "<h1>Curation report</h1><p>Which clips are selected for training, and why others are "
    yield "not. Nothing was deleted: change <code>thresholds.toml</code> and run again.</p>"
    yield '<nav><a href="#stages">Stages</a><a href="#sets">Data sets</a>'
    yield '<a href="#rejected">Rejected clips</a><a href="#scores">Scores</a></nav>'
    yield _tiles(decisions)
    counts = stage_counts(decisions)
    yield f'<h2 id="stages">Stages</h2><div class="card flow">{_flow(counts)}</div>'
    yield f'<h2 id="sets">Data sets</h2><p>Clips that each stage rejects.</p>{_table(decisions)}'
    yield '<h2 id="rejected">Rejected clips</h2>'
    yield _rejected(decisions, images) or "<p>None: every clip is selected.</p>"
    yield '<h2 id="scores">Scores</h2><p>Over all clips. Dashed lines are thresholds; a threshold '
    yield "may hold for some clips alone. Bars beyond it are in the colour of rejection.</p>"
    gated = list(dict.fromkeys(gate.score for gate in thresholds.gates))
    others = sorted({name for each in decisions for name in each.record.scores} - set(gated))
    yield _histograms(gated, decisions, thresholds)
    yield "<details><summary>Scores without a threshold</summary>"
    yield f"{_histograms(others, decisions, thresholds)}</details>"
    yield "<footer>Written by diff4splat prepare curate. The numbers are in scores.jsonl and "
    yield "decisions.csv.</footer>"


def _tiles(decisions: list[Decision]) -> str:
    selected = sum(each.is_selected for each in decisions)
    errors = sum(bool(each.record.error) for each in decisions)
    share = selected / len(decisions) if decisions else 0
    captions = sum(each.is_selected and each.record.has_caption for each in decisions)
    tiles = (
        ("", f"{len(decisions):,}", "clips"),
        ("good", f"{selected:,}", f"selected ({share:.0%})"),
        ("bad", f"{len(decisions) - selected:,}", "rejected"),
        ("bad" if errors else "", f"{errors:,}", "of these unreadable or damaged"),
        ("", f"{captions:,}", "selected with a caption"),
    )
    inner = "".join(
        f'<div class="tile"><b class="{kind}">{number}</b><span>{word}</span></div>'
        for kind, number, word in tiles
    )
    return f'<div class="tiles">{inner}</div>'


def _flow(counts: list[StageCount]) -> str:
    total = max(counts[0].entered, 1)
    return "".join(
        f'<span title="{escape(_WORDS[each.stage])}">{each.stage}</span>'
        f'<div class="track"><div class="in" style="width:{each.left / total:.2%}"></div>'
        f'<div class="out" style="width:{each.rejected / total:.2%}"></div></div>'
        f'<span class="number">{each.left:,}{_minus(each.rejected)}</span>'
        for each in counts
    )


def _minus(count: int) -> str:
    return f' <span class="bad">−{count:,}</span>' if count else ""


def _table(decisions: list[Decision]) -> str:
    head = "".join(f'<th title="{escape(_WORDS[stage])}">{stage}</th>' for stage in ORDER)
    rows = []
    for name, group in by_dataset(decisions).items():
        selected = sum(each.is_selected for each in group)
        cells = "".join(_cell(each.rejected) for each in stage_counts(group))
        rows.append(
            f"<tr><td>{escape(name)}</td><td>{len(group):,}</td><td><b>{selected:,}</b></td>"
            f"<td>{selected / len(group):.0%}</td>{cells}</tr>"
        )
    return (
        f'<div class="scroll"><table><thead><tr><th>data set</th><th>in</th><th>out</th>'
        f"<th>share</th>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _cell(count: int) -> str:
    return f'<td class="bad">{count:,}</td>' if count else '<td class="zero">0</td>'


def _histograms(scores: list[str], decisions: list[Decision], thresholds: Thresholds) -> str:
    cards = []
    for score in scores:
        values = values_of(decisions, score)
        if values:
            gates = [gate for gate in thresholds.gates if gate.score == score]
            cards.append(
                f'<div class="card"><b>{escape(score)}</b> <small>{len(values):,} clips</small>'
                f"{histogram_svg(values, gates)}</div>"
            )
    return f'<div class="histograms">{"".join(cards)}</div>'


def _rejected(decisions: list[Decision], images: dict[tuple[str, str], str | None]) -> str:
    parts = []
    for (stage, text), group in by_reason(decisions).items():
        figures = "".join(_figure(each, images.get(each.record.key)) for each in _spread(group))
        more = len(group) - min(len(group), EXAMPLES_PER_REASON)
        rest = f"<p>… and {more:,} more in decisions.csv.</p>" if more else ""
        parts.append(
            f"<details open><summary><b>{escape(text)}</b> – {len(group):,} "
            f"{'clip' if len(group) == 1 else 'clips'}, stage {escape(stage)}</summary>"
            f'<div class="examples">{figures}</div>{rest}</details>'
        )
    return "".join(parts)


def _figure(decision: Decision, address: str | None) -> str:
    record = decision.record
    image = '<div class="none">no image: the clip cannot be read</div>'
    if address is not None:
        words = f"three frames of {escape(record.identifier)}"
        image = f'<img loading="lazy" alt="{words}" src="{address}">'
    details = "".join(
        f"<span>{escape(reason.detail or reason.text)}</span>" for reason in decision.reasons
    )
    return f"<figure>{image}<figcaption>{escape(record.identifier)}{details}</figcaption></figure>"


def _spread(group: list[Decision]) -> list[Decision]:
    """Up to 20, evenly from the first to the last."""
    count = min(len(group), EXAMPLES_PER_REASON)
    return [group[round(n * (len(group) - 1) / max(count - 1, 1))] for n in range(count)]
