"""The boundary of an ego over two to four scene parameters: a map of the probability of failing."""

from collections.abc import Mapping

from risk_sac.config import EgoConfig
from risk_sac.config.boundary import BoundaryConfig
from risk_sac.records.base import Record
from risk_sac.records.run import Family


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
    """A share of the box that the axes span, with its 95 % interval from posterior samples."""

    share: float
    low: float
    high: float


class DriverMap(Record):
    """Where one driver fails."""

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
