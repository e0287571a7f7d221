"""Failure rates of an ego without an attack, and its boundary."""

from collections.abc import Mapping

from risk_sac.config import EgoConfig
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.records.base import Record
from risk_sac.records.run import Family

ANY = "failure"  # of any requirement that counts
MEANING = "A rate of this scenario under these distributions, without an attack; not one of the road."


class HourlyRate(Record):
    """Events in an hour, of a user's exposure."""

    rate: float
    low: float
    high: float


class RateEstimate(Record):
    """Rate of a requirement's violations under the declared distribution.

    Scenes that cannot be played are left out.
    """

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
    """Distribution of a parameter."""

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


class BoundaryAxis(Record):
    """A parameter that varies."""

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    levels: tuple[float, ...]
    """Values of the map's grid."""
    has_effect: bool
    """Whether passing or failing depends on it anywhere on the ego's map."""


class BoundaryPoint(Record):
    """A scene that was played or refused."""

    id: str
    """Of the episode."""
    values: tuple[float, ...]
    """One for each axis."""
    fails: bool | None
    """Of the ego; null where nothing was played."""
    refused_failure: bool
    """Whether a validity rule refuses the violation, which counts here all the same."""
    avoided_by: Mapping[str, bool]
    """r157 | fsm → whether this driver avoids a contact in this scene."""


class BoxShare(Record):
    """Share of the axes' box; 95 % interval from posterior samples."""

    share: float
    low: float
    high: float


class DriverMap(Record):
    """One driver's map of failures."""

    name: str
    """`ego`, a reference driver, or another ego as it was named."""
    judged: bool
    """Whether it is asked of the recorded episodes of all egos, instead of driving."""
    episodes: int
    """Points that the map is fitted to."""
    always: bool | None
    """Its outcome where all points end alike; null where it both passes and fails."""
    probability: tuple[float, ...]
    """Of failing at each point of the grid, last axis fastest; empty where `always` is not null."""
    deviation: tuple[float, ...]
    """Standard deviation of the latent function there."""
    fails: BoxShare
    """Share of the box in which it fails."""
    ego_fails_alone: BoxShare | None
    """Share of the box in which the ego fails and this driver does not."""


class BoundaryMap(Record):
    """The boundary that a run of the method `boundary` has found."""

    family: Family
    ego: EgoConfig
    settings: BoundaryConfig
    axes: tuple[BoundaryAxis, ...]
    fixed: Mapping[str, float]
    """Value of each other parameter that is the same in all scenes; in [0, 1] of one with words or rows."""
    points: tuple[BoundaryPoint, ...]
    refused: int
    """Scenes that could not be played."""
    maps: tuple[DriverMap, ...]
    """The ego's first."""
    notes: tuple[str, ...]
    """What limits this result, a sentence each."""
