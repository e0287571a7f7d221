"""Number of known defects that a campaign's budget detects.

It comes from benchmark runs, and says what finding nothing is worth.
"""

from typing import Literal

from risk_sac.records.base import Real, Record


class RunBudget(Record):
    """Budget of each run of a method in a family."""

    family: str
    runs: int
    """Seeds."""
    episodes: int
    """Search episodes: as the budget has them; of runs that have ended, what they played on average."""
    steps_per_episode: Real
    """Environment steps, on average."""
    estimated_from: Literal["campaign", "benchmark"]
    """Whose episodes that average is of: the campaign's own once there are some."""
    steps: int
    """Environment steps of the run."""


class DefectPower(Record):
    """Share of benchmark runs that detected a known defect within the budget."""

    defect: str
    family: str
    detected: int
    """Runs."""
    runs: int
    """That were measured, each with a seed of its own."""


class MethodPower(Record):
    """Number of known defects that a method detects with the budget."""

    method: str
    budgets: tuple[RunBudget, ...]
    """Of the campaign's families that were measured."""
    defects: tuple[DefectPower, ...]
    expected: Real
    """How many the seeds of the campaign together detect, on average."""
    at_least: bool
    """Whether the budget is larger than what was measured, so that it may detect more."""
    in_most_seeds: tuple[str, ...]
    """Defects that more than half of the runs detected."""
    at_least_once: tuple[str, ...]
    """Defects that some run detected."""
    never: tuple[str, ...]
    """Defects that no run detected."""
    sentences: tuple[str, ...]
    """The same in words, and in which families nothing was measured."""


class Power(Record):
    """Number of known defects that a campaign's budget detects, by stored benchmark runs.

    Nothing is run for it.
    """

    note: str
    """What the figures rest on."""
    comparison: str
    """Methods on the defects and steps that all were measured with; empty unless two or more were measured."""
    methods: tuple[MethodPower, ...]

    @property
    def lines(self) -> list[str]:
        """The comparison if there is one, and a line for each method."""
        lines = [f"{each.method}: {' '.join(each.sentences)}" for each in self.methods]
        return [self.comparison, *lines] if self.comparison else lines
