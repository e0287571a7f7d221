"""Server log as text or JSON lines; both name the campaign and the run."""

import logging
import re
from typing import Literal

from pythonjsonlogger.core import RESERVED_ATTRS
from pythonjsonlogger.json import JsonFormatter

from risk_sac.host.terminal import LogFormatter

SUBJECTS = ("campaign", "run")  # of a record's `extra`
_OUR_ERROR = re.compile(r"\n(?:service|risk_sac)\.[\w.]+: (?P<reason>.*)\Z", re.DOTALL)
NAMES = {"levelname": "level", "name": "logger"}


def shorten(record: logging.LogRecord) -> bool:
    """Shortens uvicorn's startup error to our reason, without the traceback."""
    known = _OUR_ERROR.search(record.msg) if isinstance(record.msg, str) else None
    if known and record.msg.startswith("Traceback"):
        record.msg = f"cannot start: {known['reason'].strip()}"
    return True


class TextFormatter(LogFormatter):
    """A line that ends with what it is about."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's own name
        """The line before a traceback."""
        about = ((name, record.__dict__.get(name)) for name in SUBJECTS)
        subjects = ", ".join(f"{name} {value}" for name, value in about if value is not None)
        return super().formatMessage(record) + (f" [{subjects}]" if subjects else "")


def set_up_logs(log_format: Literal["text", "json"]) -> None:
    """Write everything from `INFO` on to standard error, uvicorn's records included."""
    handler = logging.StreamHandler()
    handler.addFilter(shorten)
    handler.setFormatter(TextFormatter() if log_format == "text" else json_formatter())
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
    logging.getLogger("alembic").setLevel(logging.WARNING)  # it tells of every start


def json_formatter() -> logging.Formatter:
    """Makes one object per line: time, level, logger, message, extra fields."""
    return JsonFormatter(
        (*NAMES, "message"),
        rename_fields=NAMES,
        timestamp="time",
        reserved_attrs=[*RESERVED_ATTRS, "color_message", "taskName"],
    )
