"""One contact with its full time series."""

from risk_sac import series
from service.schemas.base import Body
from service.schemas.episodes import Episode


class Series(series.Series, Body):
    """Time series of an episode: `T` steps, `n` actors (the ego first), `M` requirements, `a` actions.

    Entries of an actor that is absent are null.
    """


class Failure(Episode):
    """A contact of the ego with its full time series."""

    series: Series | None
    """Null when the record is lost; `series_problem` says why."""
    series_problem: str | None
