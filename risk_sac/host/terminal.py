"""Output and log of commands on any terminal and encoding."""

import codecs
import contextlib
import io
import json
import logging
import os
import re
import sys
import time
from collections.abc import Callable, Iterable
from typing import IO, Any
from unicodedata import category

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.text import Text

# What a terminal without Unicode shows of ours; "?" for other characters.
ASCII = {"→": "->", "–": "-", "−": "-", "…": "...", "×": "x", "·": "-", "≤": "<=", "²": "2"} | {
    "λ": "lambda",
    "α": "alpha",
    "ρ": "rho",
    "\u0304": "",
}


class Output(Console):
    """A console for text of any origin.

    No character of it commands the terminal. No command ends because nothing reads it, or because foreign code has
    closed its stream.
    """

    @property
    def file(self) -> IO[str]:
        """The stream that is written to."""
        stream = super().file
        return io.StringIO() if stream.closed else stream

    @file.setter
    def file(self, stream: IO[str]) -> None:
        Console.file.fset(self, stream)  # type: ignore[attr-defined]

    def render_str(self, text: str, **style: Any) -> Text:
        """Makes text of a string, its control and direction characters escaped."""
        return super().render_str(printable(text), **style)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Renders foreign text with its control and direction characters escaped."""
        if isinstance(renderable, Text) and (shown := printable(renderable.plain)) != renderable.plain:
            renderable = Text(shown, style=renderable.style)
        return super().render(renderable, options)

    def on_broken_pipe(self) -> None:
        """Go on without output."""
        discard(self.file)


_DOUBTFUL = re.compile("[^\t\n\x20-\x7e]")

console = Output(highlight=False, emoji=False)
notes = Output(stderr=True, highlight=False, emoji=False)
errors = Output(stderr=True, highlight=False, emoji=False, soft_wrap=True)


def discard(stream: IO[str]) -> None:
    """Lead a stream nowhere."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def prepare_streams() -> None:
    """Lets output take any character, and reserves the descriptors of closed streams."""
    while (null := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(null)
    codecs.register_error("risk-sac", _as_ascii)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and not stream.closed:
            stream.reconfigure(errors="risk-sac")


def _as_ascii(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    return "".join(ASCII.get(character, "?") for character in error.object[error.start : error.end]), error.end


def flush() -> bool:
    """Writes the rest of the output; returns False if it dropped any."""
    written = True
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except ValueError:  # it is closed
            written = False
        except OSError as error:
            discard(stream)
            written &= isinstance(error, BrokenPipeError)
    return written


def printable(text: str) -> str:
    r"""Escapes control, format and direction characters as `\u202e`, except tabs and newlines.

    The escapes are those of JSON, and so a JSON document stays the same document.
    """
    return _DOUBTFUL.sub(_shown, text)


def _shown(character: re.Match[str]) -> str:
    found = character[0]
    return found if found.isprintable() or category(found) == "Zs" else json.dumps(found)[1:-1]


def complain(message: str) -> None:
    """Prints what went wrong."""
    with contextlib.suppress(OSError):  # stderr may be on a full disk, too
        errors.print(message, style="red", markup=False)


def run_command(command: Callable[[], int]) -> int:
    """Runs a command; returns its exit status, or 1 on an `OSError`."""
    prepare_streams()
    try:
        status = command()
    except OSError as error:
        complain(f"{error.filename or 'output'}: {error.strerror or error}")
        status = 1
    finally:
        written = flush()
    return status if written else status or 1


class LogFormatter(logging.Formatter):
    """Formatter of log lines that begin with their UTC time (ISO 8601)."""

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
