"""Why an upload is not taken."""

from service.errors import ServiceError


class UploadError(ServiceError):
    """An upload holds something that it must not, or does not load; the message says what and where."""


class BusyError(ServiceError):
    """As many uploads as may be are being received or checked; asking again pays after `retry_after_s` seconds."""

    def __init__(self, message: str, retry_after_s: int) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s
