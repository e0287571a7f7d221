"""Output of commands, on whatever terminal, in whatever encoding, read or not."""

import codecs
import contextlib
import io
import os
import re
import sys
from collections.abc import Callable
from typing import IO

from rich.console import Console

# What a terminal without Unicode shows of ours; "?" for other characters.
ASCII = {"→": "->", "–": "-", "−": "-", "…": "...", "×": "x", "·": "-", "≤": "<=", "²": "2"} | {
    "λ": "lambda",
    "α": "alpha",
    "ρ": "rho",
    "\u0304": "",
}


class Output(Console):
    """A console that ends no command because nothing reads it, or because foreign code has closed its stream."""

    @property
    def file(self) -> IO[str]:
        """The stream that is written to."""
        stream = super().file
        return io.StringIO() if stream.closed else stream

    @file.setter
    def file(self, stream: IO[str]) -> None:
        Console.file.fset(self, stream)  # type: ignore[attr-defined]

    def on_broken_pipe(self) -> None:
        """Go on without output."""
        discard(self.file)


# What XML 1.0 forbids, the other control characters, which a terminal would obey, and unpaired surrogates.
_UNPRINTABLE = re.compile("[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

console = Output(highlight=False)
notes = Output(stderr=True, highlight=False)
errors = Output(stderr=True, highlight=False, soft_wrap=True)


def discard(stream: IO[str]) -> None:
    """Lead a stream nowhere."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def prepare_streams() -> None:
    """Let output take any character, and keep the descriptors of closed streams from files that are opened later."""
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
    """Write what is left to write; returns False if that is not possible. Nothing is left then."""
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
    """The text without control characters, tabs and line breaks apart."""
    return _UNPRINTABLE.sub("", text)


def complain(message: str) -> None:
    """Prints what went wrong."""
    with contextlib.suppress(OSError):  # stderr may be on a full disk, too
        errors.print(printable(message), style="red", markup=False)


def run_command(command: Callable[[], int]) -> int:
    """Run a command; returns its exit status, or 1 where its output is lost or the system refuses something."""
    prepare_streams()
    try:
        status = command()
    except OSError as error:
        complain(f"{error.filename or 'output'}: {error.strerror or error}")
        status = 1
    finally:
        written = flush()
    return status if written else status or 1
