"""Power of a budget: how many known defects a method has detected within so many environment steps."""

import csv
from collections import defaultdict
from collections.abc import Collection, Sequence
from importlib.resources import files
from typing import NamedTuple

from risk_sac.errors import ConfigError

MEASURED = files("risk_sac.benchmark") / "measured.csv"  # a detections.csv of `risk-sac benchmark`


class Run(NamedTuple):
    """A run of the benchmark, as `detections.csv` has it."""

    defect: str
    family: str
    method: str
    budget_steps: int
    detected: int | None


class DefectPower(NamedTuple):
    """How often a method has detected a defect within the budget."""

    defect: str
    family: str
    detected: int
    runs: int


def runs_of(text: str) -> list[Run]:
    """Returns the runs of a `detections.csv`."""
    return [
        Run(row["defects"], row["family"], row["method"], int(row["budget_steps"]), _steps(row["detected"]))
        for row in csv.DictReader(text.splitlines())
    ]


def power(runs: Sequence[Run], families: Collection[str], method: str, steps: int) -> list[DefectPower]:
    """Returns how often a method has detected each defect in these families within so many steps.

    Raises:
      ConfigError: no run of this method in these families had such a budget.
    """
    played = [each for each in runs if each.method == method and each.family in families]
    long_enough = [each for each in played if each.budget_steps >= steps]
    if not long_enough:
        longest = max((each.budget_steps for each in played), default=0)
        got = f"{steps} steps of {method!r} in {', '.join(families)}"
        wanted = (
            f"at most {longest}" if longest else f"one of the methods {', '.join(sorted({r.method for r in runs}))}"
        )
        raise ConfigError("steps" if longest else "method", got, f"{wanted}, which has been measured")
    found: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for each in long_enough:
        found[each.defect, each.family].append(each.detected is not None and each.detected <= steps)
    return [DefectPower(defect, family, sum(each), len(each)) for (defect, family), each in found.items()]


def in_words(found: Sequence[DefectPower]) -> str:
    """Returns such as "Of 3 known defects this budget detects 1.5 on average; never: speeds."."""
    expected = sum(each.detected / each.runs for each in found)
    never = [each.defect for each in found if not each.detected]
    rest = f"never: {', '.join(never)}" if never else "each at least once"
    return f"Of {len(found)} known defects this budget detects {expected:.3g} on average; {rest}."


def _steps(text: str) -> int | None:
    return int(text) if text else None
