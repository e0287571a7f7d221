"""What a search had found when a budget was spent: distinct failures, and what a user pays for. Pure.

One run serves all budgets that are smaller than its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from risk_sac.report.runs import FinishedRun, Found

NOTHING = Found(0, 0, 0)


@dataclass(frozen=True, slots=True)
class Limit:
    """A budget."""

    name: str
    spent: Callable[[FinishedRun], Sequence[float]]  # after each search episode
    most: float


def episodes(run: FinishedRun) -> Sequence[float]:
    """1, 2, … for each search episode."""
    return range(1, len(run.phase("search")) + 1)


def cpu_s(run: FinishedRun) -> Sequence[float]:
    """Processor time to the end of each search episode, s; empty where it was not measured."""
    return run.episode_cpu_s[: len(run.phase("search"))]


HEADLINE = Limit("30 CPU s", cpu_s, 30.0)
PAID_FOR = f"preventable within {HEADLINE.name}"
LIMITS = (Limit("10 CPU s", cpu_s, 10.0), HEADLINE, Limit("300 episodes", episodes, 300.0))


def found_within(run: FinishedRun, limit: Limit) -> Found | None:
    """What the search had found with the last episode that ended within the limit; None if it never got so far."""
    spent = limit.spent(run)
    if not spent or spent[-1] < limit.most:
        return None
    within = sum(after <= limit.most for after in spent)
    return run.found[within - 1] if within else NOTHING
