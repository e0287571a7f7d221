"""Problem details (RFC 9457)."""

from enum import StrEnum

from risk_sac.records import Record


class Reason(StrEnum):
    """What went wrong, in one word that stays the same while messages change; see `detail` for the rest."""

    MALFORMED_JSON = "malformed_json"
    UNKNOWN_HOST = "unknown_host"
    UNAUTHORIZED = "unauthorized"
    FORBIDDEN = "forbidden"
    FOREIGN_ORIGIN = "foreign_origin"
    UNKNOWN_ROUTE = "unknown_route"
    UNKNOWN_ID = "unknown_id"
    METHOD_NOT_ALLOWED = "method_not_allowed"
    NOT_ACCEPTABLE = "not_acceptable"
    IDEMPOTENCY_KEY_REUSED = "idempotency_key_reused"
    NOT_ENDED = "not_ended"
    TOO_LARGE = "too_large"
    UPLOAD_TOO_SLOW = "upload_too_slow"
    UPLOAD_REFUSED = "upload_refused"
    UPLOADS_BUSY = "uploads_busy"
    PICTURES_BUSY = "pictures_busy"
    SERIES_LOST = "series_lost"
    NOT_PLAYABLE = "not_playable"
    NOT_INSTALLED = "not_installed"
    TOO_MANY_NETWORKS = "too_many_networks"
    UNSUPPORTED_MEDIA_TYPE = "unsupported_media_type"
    INVALID_FIELD = "invalid_field"
    QUOTA_EXCEEDED = "quota_exceeded"
    RATE_LIMITED = "rate_limited"
    INTERNAL_ERROR = "internal_error"
    KEYS_UNAVAILABLE = "keys_unavailable"
    CONNECTIONS_BUSY = "connections_busy"
    STORAGE_UNAVAILABLE = "storage_unavailable"
    MANAGER_STOPPED = "manager_stopped"


class FieldProblem(Record):
    """What is wrong with one field."""

    field: str
    """Dotted path as it was written, such as `budget.episodes`."""
    message: str
    got: str
    """The offending value as JSON, shortened."""
    wanted: str


class Problem(Record):
    """Problem details (RFC 9457)."""

    type: str
    title: str
    status: int
    reason: Reason
    detail: str
    instance: str
    errors: list[FieldProblem]
    """Empty when no field is to blame."""
