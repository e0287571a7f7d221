"""A report as Markdown. Of pictures it has the commands that draw them."""

import re
from collections.abc import Iterator

from risk_sac.report.evidence.document import Banner, Block, Cards, Commands, Document, Items, Paragraph, Section, Table
from risk_sac.report.evidence.html import shown
from risk_sac.report.page import table

_MARKS = re.compile(r"[\\`*\[\]]|(?<!\w)_|_(?!\w)")  # an underscore within a word is none
_TAGS = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}


def markdown(document: Document) -> str:
    """The file; the same document gives the same text."""
    return "\n".join(_lines(document)) + "\n"


def _lines(document: Document) -> Iterator[str]:
    yield f"# {_text(document.title)}\n"
    yield from _block(document.banner)
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
        case Paragraph(text):
            yield f"{_text(text)}\n"
        case Banner(text):
            yield f"> **{_text(text)}**\n"
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
