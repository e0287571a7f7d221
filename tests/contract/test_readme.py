"""Markdown files link to what exists and stay short; README.md explains what the demo prints."""

import re
from pathlib import Path

import pytest

from risk_sac import __version__
from risk_sac.cli.campaigns.output import COUNTS, RATES

ROOT = Path(__file__).parents[2]
FOLDERS = ("risk_sac", "service", "docker", "sumo_nets", "tests")
README, CHANGELOG = ROOT / "README.md", ROOT / "CHANGELOG.md"
OTHERS = sorted(
    page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md") if "node_modules" not in page.parts
)
PAGES = [README, CHANGELOG, *OTHERS]
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def linked(page: Path) -> set[Path]:
    """Pages that a page links to."""
    targets = {(page.parent / target).resolve() for target, _ in LINK.findall(text_of(page)) if target}
    return targets.intersection(PAGES)


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", text_of(page), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_readme_has_at_most_120_lines_and_900_words() -> None:
    assert len(text_of(README).splitlines()) <= 120
    assert len(text_of(README).split()) <= 900


@pytest.mark.parametrize("page", [page for page in OTHERS if page.name == "README.md"], ids=name_of)
def test_every_other_readme_has_at_most_1000_words(page: Path) -> None:
    assert len(text_of(page).split()) <= 1000


def test_readme_explains_every_column_of_the_demo() -> None:
    for column in ("family", "method", *COUNTS, *RATES):
        name = column.replace("-\n", "").replace("\n", " ")
        assert f"\n| {name} |" in text_of(README), name


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in LINK.findall(text_of(page)):
        if "://" in target:
            continue
        found = page.parent / target if target else page
        assert found.exists(), target
        assert not anchor or anchor in anchors(found / "README.md" if found.is_dir() else found), f"{target}#{anchor}"


def test_every_page_is_reached_from_the_readme() -> None:
    reached, new = set[Path](), {README}
    while new:
        reached |= new
        new = set[Path]().union(*map(linked, new)) - reached
    assert set(PAGES) == reached


def test_first_heading_of_the_changelog_is_the_version_of_the_package() -> None:
    assert re.findall(r"^## (\S+)", text_of(CHANGELOG), re.M)[0] == __version__
