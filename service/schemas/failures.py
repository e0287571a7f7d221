"""Where a contact came about, and how its twin went."""

from risk_sac.failures.question import Twin
from risk_sac.failures.roads import Use
from risk_sac.records import Collision, Record
from risk_sac.series import Series


class Surface(Record):
    """A piece of ground that one drives or walks on."""

    use: Use
    outline: list[tuple[float, float]]
    """Its corners, m, on the map that the series is on; the last one is joined to the first."""


class Roads(Record):
    """The ground on which a contact came about."""

    surfaces: list[Surface]
    """In the order in which they are to be drawn; none where the scene's family had other roads then."""


class TwinPlay(Record):
    """The scene of a contact, played with one thing changed."""

    twin: Twin
    """`idle`: nobody attacks; else the profile of another ego."""
    outcome: str
    """In words, such as "touches nobody"."""
    collision: Collision | None
    """Null if the ego touches nobody."""
    series: Series
    """From the same start as the contact's own, up to 3 s after it, or until the ego touches somebody."""
