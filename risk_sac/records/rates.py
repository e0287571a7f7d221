"""Failure rates of an ego in a scenario, estimated from weighted draws."""

from collections.abc import Mapping

from risk_sac.records.base import Record

ANY = "failure"  # of any requirement that counts
MEANING = "A rate of this scenario under these distributions, without an attack; not one of the road."


class HourlyRate(Record):
    """Events in an hour, of a user's exposure."""

    rate: float
    low: float
    high: float


class RateEstimate(Record):
    """How often the ego violates a requirement in scenes of the declared distribution that can be played."""

    failures: int
    """Among the draws, of which the proposal has many more than the declared distribution."""
    rate: float | None
    """In a scene; null: not estimated."""
    low: float | None
    """Of the 95 % interval."""
    high: float | None
    why: str
    """Why it is not estimated; empty where it is."""
    at_most: float
    """One-sided 95 % bound that needs no checks, by the largest weight that a draw may have."""
    effective_failures: float
    """Number of failures of equal weight that would tell as much."""
    largest_share: float
    """Share of the estimate that a single draw has."""
    declared_share: float
    """Share of the estimate from draws of the declared distribution, where fitted proposals did not reach."""
    per_hour: HourlyRate | None = None
    """With the exposure; null without one, or without an estimate."""


class DeclaredParameter(Record):
    """How a parameter is drawn."""

    kind: str
    """Of its distribution; `uniform` also where none is declared."""
    source: str
    """Publication; empty: a choice."""


class Rates(Record):
    """Failure rates of an ego in a scenario."""

    run_id: str
    meaning: str = MEANING
    draws: int
    """Episodes, of those that were asked for."""
    asked: int
    played: int
    """All others were refused before the first step, or did not end: of these scenes nothing is said."""
    scenes_per_hour: float | None
    """The user's; null: none was stated."""
    rates: Mapping[str, RateEstimate]
    """`failure`, of any requirement that counts, and requirement → estimate."""
    distributions: Mapping[str, DeclaredParameter]
    """Parameter → how it is drawn."""
    correlated: tuple[str, ...]
    """Parameters with a rank correlation; all others are independent."""
