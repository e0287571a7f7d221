"""A report as one HTML file that needs nothing else: no script, no request, no font, no picture from elsewhere."""

import base64
import re
from functools import cache
from importlib.resources import files
from itertools import count

from jinja2 import Environment, StrictUndefined, Template

from risk_sac.report.evidence.document import Document, Picture

# For whoever opens it, as a file or from a server.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
# Control characters, what turns the direction of text, and halves of pairs.
_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")


def html(document: Document) -> str:
    """The file; the same document gives the same text."""
    return _template().render(document=document, policy=POLICY, ids=Counter())


class Counter:
    """Numbers regions, so that no two have the same name."""

    def __init__(self) -> None:
        self._next = count(1)

    def next(self) -> int:
        """The first is 1."""
        return next(self._next)


def shown(text: str) -> str:
    """Without what one cannot see; the template escapes it after that."""
    return _UNSEEN.sub("\ufffd", text)


def _inline(picture: Picture) -> str:
    """As an image, an SVG can run nothing and load nothing."""
    return f"data:{picture.media_type};base64,{base64.b64encode(picture.content).decode()}"


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"shown": shown, "inline": _inline}
    return environment.from_string((files(__package__) / "report.html").read_text(encoding="utf-8"))
