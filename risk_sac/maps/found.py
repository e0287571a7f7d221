"""Results of a search for places on a map."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from risk_sac.config import Scenario
from risk_sac.scenario.tracks import Track

Pattern = Literal["car_following", "crossing", "junction"]
TITLES: dict[Pattern, str] = {  # what people read
    "car_following": "Car following",
    "crossing": "Hidden pedestrian",
    "junction": "Junction",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """Somewhere on a map that a pattern might be placed."""

    pattern: Pattern
    id: str  # such as an edge, or a junction and one of its edges: what a user names it by
    x_m: float
    y_m: float

    def told(self) -> dict[str, object]:
        """The spot as it is written as JSON."""
        return {"pattern": self.pattern, "place": self.id, "x_m": self.x_m, "y_m": self.y_m}


@dataclass(frozen=True, slots=True)
class Fit:
    """A spot where a pattern fits."""

    spot: Spot
    scenario: Scenario
    tracks: tuple[Track, ...]
    """On which vehicles may start."""
    rare: bool = False
    """Whether contacts are hardly possible."""

    @property
    def summary(self) -> str:
        """Summarises the place and its rare contacts."""
        return self.scenario.summary + (" Contacts are rare here: no vehicle can cut in." if self.rare else "")

    def told(self) -> dict[str, object]:
        """The place as it is written as JSON."""
        return self.spot.told() | {"summary": self.summary, "rare": self.rare}


@dataclass(frozen=True, slots=True)
class Misfit:
    """A spot where a pattern does not fit, and why."""

    spot: Spot
    why: str

    def told(self) -> dict[str, object]:
        """The spot and the reason as they are written as JSON."""
        return self.spot.told() | {"why": self.why}


class NoFit(Exception):
    """Why a pattern does not fit; for the finders alone."""


def lacking(got: float, unit: str, wanted: float) -> str:
    """Says a number and the larger one that was wanted, to one digit that tells them apart."""
    below, above = math.floor(got * 10.0) / 10.0, math.ceil(round(wanted * 10.0, 6)) / 10.0
    return f"{below:g} {unit}; wanted {above:g} {unit}"


@dataclass(frozen=True, slots=True)
class Survey:
    """All places of a map, and why elsewhere there is none; in the order of the net."""

    fits: tuple[Fit, ...]
    misfits: tuple[Misfit, ...]
    nowhere: Mapping[Pattern, str]  # why a pattern has neither

    @property
    def counts(self) -> Counter[str]:
        """Places by pattern."""
        return Counter(fit.spot.pattern for fit in self.fits)
