"""A contact's twin as a body."""

from risk_sac.failures.question import Twin, read_twin
from service.schemas.failures import TwinPlay
from service.views.series import series_body


def twin_body(twin: Twin, played: bytes) -> TwinPlay:
    """A twin with its full time series.

    Args:
      twin: which.
      played: as a study told it.
    """
    told, arrays = read_twin(played)
    return TwinPlay(twin=twin, outcome=told.outcome, collision=told.collision, series=series_body(arrays))
