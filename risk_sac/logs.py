"""Log lines of workers and of the service."""

import logging
import time


class LogFormatter(logging.Formatter):
    """Formatter of lines that begin with their time in UTC, as ISO 8601."""

    converter = staticmethod(time.gmtime)
    default_time_format = "%Y-%m-%dT%H:%M:%S"
    default_msec_format = "%s.%03d+00:00"

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")


def log_to_stderr() -> None:
    """Writes everything from `INFO` on to standard error."""
    handler = logging.StreamHandler()
    handler.setFormatter(LogFormatter())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
