"""Pages link to existing files, stay short, and use the code's names."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import get_args

import pytest

from risk_sac import __version__
from risk_sac.cli.campaigns.watch import COUNTS, RATES
from risk_sac.config import Requirement, RunSpec
from risk_sac.env.problem import Problem
from risk_sac.failures.from_above import MARKS
from risk_sac.maps.found import TITLES, Pattern
from risk_sac.risk.requirements import SIGNALS
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.reading import PAPER_FAMILIES
from service.api.routes.catalogue import list_families

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


def test_the_changelog_has_the_version_of_the_package_and_what_comes_next() -> None:
    versions = re.findall(r"^## (\S+)( \(unreleased\))?", text_of(CHANGELOG), re.M)
    assert (__version__ == versions[0][0]) or (versions[0][1] and __version__ == versions[1][0])


RISK = (ROOT / "risk_sac" / "risk" / "README.md").read_text(encoding="utf-8")


def defaults(family: str) -> tuple[Requirement, ...]:
    """What a run of default settings is judged by."""
    return Problem.from_spec(RunSpec(family=family, method="random", seed=0)).requirements


def signal_rows() -> list[str]:
    return [f"| `{name}` | {i.unit} | {i.low:g} to {i.high:g} | {i.meaning} |" for name, i in SIGNALS.items()]


def requirement_rows() -> list[str]:
    """Each once, with the families that have it."""
    families: dict[Requirement, list[str]] = {}
    for family in PAPER_FAMILIES:
        for requirement in defaults(family):
            families.setdefault(requirement, []).append(family)
    return [
        f"| `{r.name}` | {', '.join(names)} | `{r.formula}` | {r.scale:g} | {r.counts} | {_yes_or_no(r.shapes)} |"
        for r, names in families.items()
    ]


def _yes_or_no(answer: bool) -> str:
    return "yes" if answer else "no"


def test_the_page_has_every_signal_and_default_requirement_as_the_code_has_them() -> None:
    for rows in (signal_rows(), requirement_rows()):
        assert "\n".join(["|---" * (rows[0].count(" | ") + 1) + "|", *rows, ""]) in RISK, "\n".join(rows)


def test_the_service_tells_them_too() -> None:
    told = list_families()
    assert [signal.name for signal in told.signals] == list(SIGNALS)
    assert all(signal.unit and signal.meaning and signal.low < signal.high for signal in told.signals)
    assert {family.name: tuple(family.requirements) for family in told.items} == {
        name: defaults(name) for name in FAMILIES
    }


PLACES = ROOT / "service" / "web" / "src" / "screens" / "maps" / "places.ts"


def test_the_page_titles_the_patterns_as_the_code_does() -> None:
    told = re.findall(r'\{ name: "(\w+)", title: "([^"]+)"', PLACES.read_text(encoding="utf-8"))
    assert dict(told) == TITLES
    assert set(TITLES) == set(MARKS) == set(get_args(Pattern))


PAGE = ROOT / "service" / "web"


def test_geometry_and_time_of_the_page() -> None:
    npm = shutil.which("npm")
    if npm is None or not (PAGE / "node_modules").is_dir():
        pytest.skip("the page's unit tests need npm, and what `make page` installs")
    said = subprocess.run([npm, "test"], cwd=PAGE, capture_output=True, text=True)
    assert said.returncode == 0, said.stdout[-4000:] + said.stderr[-2000:]
