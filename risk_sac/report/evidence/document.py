"""What a report is made of, before it is HTML or Markdown. All text is plain: whoever renders it escapes it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A few sentences."""

    text: str
    kind: Literal["paragraph"] = "paragraph"


@dataclass(frozen=True, slots=True)
class Banner:
    """What nobody may overlook."""

    text: str
    kind: Literal["banner"] = "banner"


@dataclass(frozen=True, slots=True)
class Items:
    """Facts, one a line."""

    items: Sequence[str]
    kind: Literal["items"] = "items"


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under heads; the first `left` columns hold words, the others numbers."""

    name: str  # what it is called where a caption is wanted
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1
    kind: Literal["table"] = "table"


@dataclass(frozen=True, slots=True)
class Commands:
    """What to type."""

    lines: Sequence[str]
    kind: Literal["commands"] = "commands"


@dataclass(frozen=True, slots=True)
class Picture:
    """An image that the page holds itself."""

    alt: str
    media_type: str
    content: bytes


@dataclass(frozen=True, slots=True)
class Card:
    """One kind of failure."""

    title: str
    lines: Sequence[str]
    command: str
    picture: Picture | None
    missing: str = ""  # why there is no picture


@dataclass(frozen=True, slots=True)
class Cards:
    """Several of them, side by side where there is room."""

    cards: Sequence[Card]
    kind: Literal["cards"] = "cards"


Block = Paragraph | Banner | Items | Table | Commands | Cards


@dataclass(frozen=True, slots=True)
class Section:
    """Blocks under a title."""

    id: str  # unique within the document; letters and hyphens
    title: str
    blocks: Sequence[Block]
    parts: Sequence["Section"] = field(default=())


@dataclass(frozen=True, slots=True)
class Document:
    """A whole report."""

    title: str
    banner: Banner
    facts: Sequence[tuple[str, str]]
    sections: Sequence[Section]
