"""Errors of the service; `service.api.problems` maps them to HTTP statuses."""

from collections.abc import Iterator
from contextlib import contextmanager

from risk_sac.errors import RiskSacError


class ServiceError(RiskSacError):
    """Root of the service's errors."""


class NotFoundError(ServiceError):
    """Unknown id; `field` is the path parameter and `got` its value."""

    def __init__(self, message: str, *, field: str, got: str) -> None:
        super().__init__(message)
        self.field = field
        self.got = got


class ConflictError(ServiceError):
    """Request that conflicts with stored state; `reason` is a stable name."""

    def __init__(self, message: str, *, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class QuotaError(ServiceError):
    """Exhausted share of a project or key; retry after `retry_after_s` seconds."""

    def __init__(self, message: str, retry_after_s: float) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class KeysError(ServiceError):
    """Key file that is unreadable, not writable or damaged, or unknown key."""


class StorageError(ServiceError):
    """Read or write refused by database or disk; the message says why."""


@contextmanager
def disk_refusals(what: str) -> Iterator[None]:
    """Turns an OSError within the body into a StorageError about `what`."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"{what} ({error.strerror})") from error


class OutdatedError(StorageError):
    """Stored campaign of an incompatible version: listable, deletable; its runs fail."""


class SeriesLost(StorageError):
    """Time series of a failure that is not recorded, missing or damaged."""


class NotPlayable(ServiceError):
    """Failure that does not repeat or cannot play; the message says why."""


class UploadError(ServiceError):
    """Upload refused or not loadable; the message says what and where."""


class BusyError(ServiceError):
    """Limit on concurrent work; `reason` names it; retry after `retry_after_s` seconds."""

    def __init__(self, message: str, retry_after_s: int, reason: str = "uploads_busy") -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s
        self.reason = reason


class TransitionError(ServiceError):
    """State change outside the table of transitions: a bug in the service."""
