"""Signals and default requirements are told as the code has them, in README and by the service."""

from pathlib import Path

from risk_sac.config import Requirement, RunSpec
from risk_sac.problem import Problem
from risk_sac.risk.signals import SIGNALS
from risk_sac.scenario.families import FAMILIES
from service.api.routes.catalogue import list_families

PAGE = (Path(__file__).parents[2] / "risk_sac" / "risk" / "README.md").read_text(encoding="utf-8")


def defaults(family: str) -> tuple[Requirement, ...]:
    """What a run of default settings is judged by."""
    return Problem.from_spec(RunSpec(family=family, method="random", seed=0)).requirements


def signal_rows() -> list[str]:
    return [f"| `{name}` | {i.unit} | {i.low:g} to {i.high:g} | {i.meaning} |" for name, i in SIGNALS.items()]


def requirement_rows() -> list[str]:
    """Each once, with the families that have it."""
    families: dict[Requirement, list[str]] = {}
    for family in FAMILIES:
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
        assert "\n".join(["|---" * (rows[0].count(" | ") + 1) + "|", *rows, ""]) in PAGE, "\n".join(rows)


def test_the_service_tells_them_too() -> None:
    told = list_families()
    assert [signal.name for signal in told.signals] == list(SIGNALS)
    assert all(signal.unit and signal.meaning and signal.low < signal.high for signal in told.signals)
    assert {family.name: tuple(family.requirements) for family in told.items} == {
        name: defaults(name) for name in FAMILIES
    }
