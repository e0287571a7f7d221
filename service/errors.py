"""Errors of the service; `service.api.answers.problems` maps them to HTTP statuses."""

from risk_sac.errors import RiskSacError


class ServiceError(RiskSacError):
    """Root of the service's errors."""


class NotFoundError(ServiceError):
    """Nothing has this id; `field` is the path parameter and `got` its value."""

    def __init__(self, message: str, *, field: str, got: str) -> None:
        super().__init__(message)
        self.field = field
        self.got = got


class ConflictError(ServiceError):
    """What is asked for does not fit what there is; `reason` is a stable name for why."""

    def __init__(self, message: str, *, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class QuotaError(ServiceError):
    """A project, or a key, has used up its share; asking again pays after `retry_after_s` seconds."""

    def __init__(self, message: str, retry_after_s: float) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class KeysError(ServiceError):
    """The file of the API keys cannot be read or written, is damaged, or has no such key."""


class StorageError(ServiceError):
    """The database or the data folder refused a read or a write; the message is the reason."""


class OutdatedError(StorageError):
    """What a stored campaign asks for is refused by now; it can be listed and deleted, and its runs fail."""


class SeriesLost(StorageError):
    """The time series of a failure was not recorded, or its file is gone or damaged."""


class NotPlayable(ServiceError):
    """A failure does not repeat here, or cannot be played as was asked; the message says why."""


class UploadError(ServiceError):
    """An upload holds something that it must not, or does not load; the message says what and where."""


class BusyError(ServiceError):
    """As much is at work as may be; `reason` names what, and asking again pays after `retry_after_s` seconds."""

    def __init__(self, message: str, retry_after_s: int, reason: str = "uploads_busy") -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s
        self.reason = reason


class TransitionError(ServiceError):
    """A state change outside the table of transitions: a bug, never a user's mistake."""
