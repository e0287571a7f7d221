"""One contact with its full time series, where it came about, and how its twin went."""

from risk_sac import series
from risk_sac.failures.question import Twin
from risk_sac.failures.roads import Use
from service.schemas.base import Body
from service.schemas.episodes import Collision, Episode
from service.schemas.triage import Triage


class Series(series.Series, Body):
    """Time series of an episode: `T` steps, `n` actors (the ego first), `M` requirements, `a` actions.

    Entries of an actor that is absent are null.
    """


class Failure(Episode):
    """A contact of the ego with its full time series."""

    series: Series | None
    """Null when the record is lost; `series_problem` says why."""
    series_problem: str | None
    triage: Triage | None
    """What people made of it; null if nobody has."""


class Surface(Body):
    """A piece of ground that one drives or walks on."""

    use: Use
    outline: list[tuple[float, float]]
    """Its corners, m, on the map that the series is on; the last one is joined to the first."""


class Roads(Body):
    """The ground on which a contact came about."""

    surfaces: list[Surface]
    """In the order in which they are to be drawn; none where the scene's family had other roads then."""


class TwinPlay(Body):
    """The scene of a contact, played with one thing changed."""

    twin: Twin
    """`idle`: nobody attacks; else the profile of another ego."""
    outcome: str
    """In words, such as "touches nobody"."""
    collision: Collision | None
    """Null if the ego touches nobody."""
    series: Series
    """From the same start as the contact's own, up to 3 s after it, or until the ego touches somebody."""
