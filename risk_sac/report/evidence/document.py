"""Builds a report from blocks; writes it as HTML and Markdown.

All text is plain until then.
"""

import base64
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import count
from typing import NamedTuple

from jinja2 import Environment, StrictUndefined, Template

from risk_sac.report.page import table


@dataclass(frozen=True, slots=True)
class Items:
    """Facts, one a line."""

    items: Sequence[str]


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under heads; the first `left` columns hold words, the others numbers."""

    name: str  # what it is called where a caption is wanted
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1


@dataclass(frozen=True, slots=True)
class Commands:
    """Commands for the reader to type."""

    lines: Sequence[str]


class Drawing(NamedTuple):
    """An SVG, or why there is none."""

    svg: bytes | None
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Card:
    """One kind of failure."""

    title: str
    lines: Sequence[str]
    command: str
    drawing: Drawing


@dataclass(frozen=True, slots=True)
class Cards:
    """Several of them, side by side where there is room."""

    cards: Sequence[Card]


Block = str | Items | Table | Commands | Cards  # text is a paragraph


@dataclass(frozen=True, slots=True)
class Section:
    """Blocks under a title."""

    id: str  # unique within the document; letters and hyphens
    title: str
    blocks: Sequence[Block]
    parts: Sequence["Section"] = ()


@dataclass(frozen=True, slots=True)
class Document:
    """A whole report."""

    title: str
    banner: str  # stands out at the top
    facts: Sequence[tuple[str, str]]
    sections: Sequence[Section]


# For a browser that opens it, as a file or from a server.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
# Control characters, what turns the direction of text, and halves of pairs.
_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")


def html(document: Document) -> str:
    """The file; the same document gives the same text."""
    return _template().render(document=document, policy=POLICY, number=count(1).__next__)


def shown(text: str) -> str:
    """Without what one cannot see; the template escapes it after that."""
    return _UNSEEN.sub("\ufffd", text)


def _inline(svg: bytes) -> str:
    """As an image, an SVG can run nothing and load nothing."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


def _kind(block: Block) -> str:
    return type(block).__name__


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"shown": shown, "inline": _inline, "kind": _kind}
    return environment.from_string((files(__package__) / "report.html").read_text(encoding="utf-8"))


_MARKS = re.compile(r"[\\`*\[\]]|(?<!\w)_|_(?!\w)")  # an underscore within a word is none
_TAGS = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}


def markdown(document: Document) -> str:
    """The file; the same document gives the same text."""
    return "\n".join(_lines(document)) + "\n"


def _lines(document: Document) -> Iterator[str]:
    yield f"# {_text(document.title)}\n"
    yield f"> **{_text(document.banner)}**\n"
    yield from (f"- {_text(name)}: {_text(value)}" for name, value in document.facts)
    for section in document.sections:
        yield from _section(section, "##")


def _section(section: Section, mark: str) -> Iterator[str]:
    yield f"\n{mark} {_text(section.title)}\n"
    for block in section.blocks:
        yield from _block(block)
    for part in section.parts:
        yield from _section(part, f"{mark}#")


def _block(block: Block) -> Iterator[str]:
    match block:
        case str():
            yield f"{_text(block)}\n"
        case Items(items):
            yield from (f"- {_text(item)}" for item in items)
            yield ""
        case Table(_, columns, rows, left):
            yield table([_text(name) for name in columns], ([_text(cell) for cell in row] for row in rows), left)
        case Commands(lines):
            yield from _code(*lines)
        case Cards(cards):
            for card in cards:
                yield f"**{_text(card.title)}**\n"
                yield from (f"- {_text(line)}" for line in card.lines)
                yield from ("", *_code(card.command))


def _code(*lines: str) -> Iterator[str]:
    """A fence longer than any within it."""
    text = "\n".join(map(shown, lines))
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    yield f"{fence}\n{text}\n{fence}\n"


def _text(text: str) -> str:
    """On one line, and nothing in it is a mark or HTML."""
    plain = " ".join(shown(text).split()).translate(_TAGS)
    return _MARKS.sub(lambda mark: f"\\{mark[0]}", plain)
