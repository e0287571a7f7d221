"""Results of old failures with another ego; see `risk_sac.failures.regress`."""

from collections import Counter
from datetime import datetime
from enum import StrEnum
from typing import Literal

from pydantic import computed_field

from risk_sac.config import EgoConfig
from risk_sac.records import Grade, Record, State


class Verdict(StrEnum):
    """Result of an old failure with another ego."""

    FIXED = "fixed"
    STILL_FAILING = "still_failing"
    NEW_KIND = "new_kind"  # another striker, type of conflict or requirement
    FLAKY = "flaky"  # not the same twice
    NOT_COMPARABLE = "not_comparable"


class Case(Record):
    """One failure, against the other ego."""

    id: str
    digest: str
    """Of its trajectory: failures of different campaigns, and a failure and its core, share an id."""
    name: str
    """Its kind, in words."""
    grade: Grade | None
    verdict: Verdict
    reason: str
    """In words: what happened instead, or why it cannot be compared."""
    found: str = ""
    """Signature of the failure that happens instead; empty where none does."""
    known: bool = False
    """Whether a baseline has it with the same verdict and the same failure instead."""

    @property
    def passed(self) -> bool:
        """Whether it passes: it is fixed, or known from the baseline."""
        return self.known or self.verdict is Verdict.FIXED

    @property
    def verdict_in_words(self) -> str:
        """The verdict, and whether the case was known."""
        return f"{_words(self.verdict)}{', known' if self.known else ''}"


def _words(verdict: Verdict) -> str:
    return verdict.replace("_", " ")


class Regression(Record):
    """All cases, in the order of the failures."""

    ego: EgoConfig
    cases: tuple[Case, ...]

    @property
    def passed(self) -> bool:
        """Whether all of them are fixed or known."""
        return all(case.passed for case in self.cases)

    @property
    def counts_in_words(self) -> str:
        """Counts the cases of each verdict, in words."""
        counts = Counter(_words(case.verdict) for case in self.cases)
        return ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))

    def beside(self, baseline: "Regression") -> "Regression":
        """Marks the cases that the baseline has too as known.

        Such a case has the same verdict and the same failure instead.
        """
        known = {(case.digest, case.verdict, case.found) for case in baseline.cases}
        cases = tuple(
            case.model_copy(update={"known": (case.digest, case.verdict, case.found) in known}) for case in self.cases
        )
        return self.model_copy(update={"cases": cases})


class CampaignRegression(Record):
    """The distinct failures of a campaign against another ego, as the service plays them."""

    id: str
    campaign_id: str
    ego: EgoConfig
    state: Literal[State.QUEUED, State.RUNNING, State.SUCCEEDED, State.FAILED] = State.QUEUED
    reason: str | None = None
    """Why it failed."""
    created_at: datetime
    finished_at: datetime | None = None
    cases: tuple[Case, ...] = ()
    """One for each distinct failure of each run."""

    @computed_field  # type: ignore[prop-decorator]
    @property
    def passed(self) -> bool | None:
        """Whether all failures are fixed; null until it has succeeded."""
        return all(case.passed for case in self.cases) if self.state is State.SUCCEEDED else None
