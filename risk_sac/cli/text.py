"""Text of others, before it meets a terminal or an XML file."""

import re
from collections.abc import Iterable

# What XML 1.0 forbids, the other control characters, which a terminal would obey, and unpaired surrogates.
_UNPRINTABLE = re.compile("[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


# What names an ego.
EGO = "default, perfect, careful, a registered ego, or a YAML file with the fields of a campaign's ego"


def printable(text: str) -> str:
    """The text without control characters, tabs and line breaks apart."""
    return _UNPRINTABLE.sub("", text)


def on_one_line(text: str) -> str:
    """The text without control characters, every run of white space a single space."""
    return " ".join(printable(text).split())


def counted(count: int, noun: str) -> str:
    """A count with its noun: `1 failure`, `2 failures`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def in_words(names: Iterable[str]) -> str:
    """Names of rules or of what was broken, as words."""
    return ", ".join(names).replace("_", " ")
