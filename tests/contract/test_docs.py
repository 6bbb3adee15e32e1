"""Pages are short and in the field's words; links, figures, paths and imports in them exist."""

import ast
import re
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
LINE_LIMIT = 250
SOURCES = "diff4splat|models|training|data_prep|configs|tests|benchmarks|examples|docs"
COINED = (
    r"told|untold|wholes|judged|kept back|held[- ]out|stands? still|standing still|things?"
    r"|as (?:they|it) came out|way back|goes as"
)
CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def prose(page: Path) -> str:
    """A page without code and link targets."""
    return LINK.sub("]", CODE.sub("", page.read_text(encoding="utf-8")))


def links(page: Path) -> list[str]:
    """Targets of a page's relative links and figures, outside of code."""
    targets = LINK.findall(CODE.sub("", page.read_text(encoding="utf-8")))
    return [target for target in targets if "://" not in target]


def anchors(page: Path) -> set[str]:
    """Names that GitHub gives to the headings of a page."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_and_figures_exist(page: Path) -> None:
    broken = []
    for target in links(page):
        path, _, anchor = unquote(target).partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(target)
    assert not broken


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=named)
def test_pages_are_short(page: Path) -> None:
    assert len(page.read_text(encoding="utf-8").splitlines()) <= LINE_LIMIT


def test_the_index_names_every_page() -> None:
    index = DOCS / "README.md"
    listed = {(DOCS / target).resolve() for target in links(index)}
    pages = {page for page in DOCS.rglob("*.md") if "figures" not in page.parts} - {index}
    assert not sorted(named(page) for page in pages - listed)


def test_every_figure_is_shown() -> None:
    shown = {(page.parent / target).resolve() for page in PAGES for target in links(page)}
    figures = {*DOCS.glob("figures/*.png"), *DOCS.glob("figures/*.jpg")}
    assert not sorted(named(figure) for figure in figures - shown)


def test_decisions_have_context_decision_and_consequences_on_one_page() -> None:
    for page in sorted((DOCS / "adr").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        for part in ("Context", "Decision", "Consequences"):
            assert f"**{part}.**" in text, f"{page.name}: {part}"
        assert len(text.splitlines()) <= 50, page.name


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=named)
def test_pages_use_the_fields_words(page: Path) -> None:
    assert not re.findall(rf"\b(?:{COINED})\b", prose(page), re.IGNORECASE)


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=named)
def test_paths_in_the_repository_exist(page: Path) -> None:
    spans = re.findall(r"`([^`\n]+)`", page.read_text(encoding="utf-8"))
    words = [word for span in spans for word in span.split()]
    paths = [word for word in words if re.match(rf"(?:{SOURCES})/[^<*{{]*$", word)]
    assert not [path for path in paths if not (ROOT / path).exists()]


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_imports_in_programs_work(page: Path) -> None:
    for program in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        for node in ast.walk(ast.parse(program)):
            if isinstance(node, ast.Import | ast.ImportFrom):
                exec(ast.unparse(node), {})
