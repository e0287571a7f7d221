"""The pages link to what exists, and README explains what the demo prints."""

import re
from pathlib import Path

import pytest

from risk_sac.cli.campaigns.output import COUNTS, RATES

ROOT = Path(__file__).parents[2]
FOLDERS = ("risk_sac", "service", "docker", "sumo_nets", "tests")
OURS = sorted(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md") if "node_modules" not in page.parts)
PAGES = [ROOT / "README.md", *OURS]
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")


def anchors(page: Path) -> set[str]:
    """Of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_readme_has_at_most_250_lines() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 250


def test_glossary_explains_every_column_of_the_demo() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for column in ("family", "method", *COUNTS, *RATES):
        name = column.replace("-\n", "").replace("\n", " ")
        assert f"\n| {name} |" in readme, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        found = page.parent / target if target else page
        assert found.exists(), target
        assert not anchor or anchor in anchors(found / "README.md" if found.is_dir() else found), f"{target}#{anchor}"


def test_every_page_is_linked_from_the_main_one() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    linked = {ROOT / target for target, _ in LINK.findall(readme) if "://" not in target}
    assert set(PAGES[1:]) <= linked
