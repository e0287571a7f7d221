"""When a conjunction acts, and on which of the others."""

from typing import Literal

from risk_sac.config import Settings
from risk_sac.scenario.bodies import BodyName

Range = tuple[float, float]


class Condition(Settings):
    """When a defect acts, and on which of the others; all that is given has to hold."""

    ego_mps: Range | None = None
    """Speed of the ego."""
    friction: Range | None = None
    """Of the road."""
    turning: bool = False
    """The ego's path turns within the next metres."""
    stopped: bool = False
    """The ego has stood since it took over."""
    bodies: tuple[BodyName, ...] = ()
    """Of the other, by its size."""
    other_mps: Range | None = None
    """Speed of the other."""
    side: Literal["left", "right"] | None = None
    """Of the ego's heading, on which the other is."""
    way: Literal["same", "crossing", "oncoming"] | None = None
    """Heading of the other against the ego's."""
    follows: bool = False
    """The other drives behind a vehicle that is not the ego."""
    hidden_s: float | None = None
    """The other has come into the line of sight after so long out of it."""
