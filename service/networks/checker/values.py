"""What an attribute of a network, route or additional file may say.

SUMO reads some values as names of files, replaces `${NAME}` by the server's environment, and takes NaN and 1e308 for
numbers. None of that passes: each attribute has one of the types below, and a text that fits it is harmless.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

from service.networks.limits import MAX_COORDINATE, MAX_LANES, MAX_NAME, MAX_NUMBER


@dataclass(frozen=True, slots=True)
class Type:
    """What a value must be, in words and as a test."""

    wanted: str
    holds: Callable[[str], object]


def _matching(wanted: str, pattern: str) -> Type:
    return Type(wanted, re.compile(pattern, re.ASCII).fullmatch)


_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_WHOLE = re.compile(r"-?\d{1,10}", re.ASCII)
_WORD = re.compile(r"[\w.:%+-]{1,100}", re.ASCII)
_NOT_IN_IDENTIFIERS = re.compile(r"[\s|\\'\";,<>&$]")  # SUMO's own rule, and $
_COORDINATE = r"-?\d{1,8}(?:\.\d{0,16})?"
_SPECIAL_WORDS = ("nan", "inf", "infinity")  # that SUMO reads as numbers, with a sign too


def number(low: float, high: float) -> Type:
    """A decimal number in [low, high]; NaN and infinity are in no range."""

    def holds(text: str) -> bool:
        return _NUMBER.fullmatch(text) is not None and low <= float(text) <= high

    return Type(f"a number from {low:g} to {high:g}", holds)


def whole(low: int, high: int) -> Type:
    """A whole number in [low, high]."""

    def holds(text: str) -> bool:
        return _WHOLE.fullmatch(text) is not None and low <= int(text) <= high

    return Type(f"a whole number from {low} to {high}", holds)


def is_identifier(text: str) -> bool:
    """Whether SUMO and we both take a text for the id of one thing."""
    return 0 < len(text) <= MAX_NAME and text.isprintable() and not _NOT_IN_IDENTIFIERS.search(text)


def _is_word(text: str) -> bool:
    if not _WORD.fullmatch(text) or text.lower().lstrip("+-") in _SPECIAL_WORDS:
        return False
    return _NUMBER.fullmatch(text) is None or abs(float(text)) <= MAX_NUMBER


def _are(holds: Callable[[str], object], separators: str = " ") -> Callable[[str], bool]:
    split = re.compile(f"[{separators}]+")
    return lambda text: all(holds(part) for part in split.split(text.strip()) if part)


def points(shape: str) -> list[tuple[float, float]]:
    """The points of a shape, m; heights are left out."""
    return [(float(x), float(y)) for x, y, *_ in (point.split(",") for point in shape.split())]


_COORDINATES = rf"{_COORDINATE},{_COORDINATE}(?:,{_COORDINATE})?"
_SHAPE = re.compile(rf"{_COORDINATES}(?: {_COORDINATES})* ?", re.ASCII)
# No grids and no pipelines: they name files that PROJ would open.
_PROJECTION_KEYS = (
    "proj|zone|south|north|ellps|datum|units|no_defs|type|towgs84|vunits|lat_0|lat_1|lat_2|lat_ts|lon_0|lonc|"
    "alpha|gamma|k|k_0|x_0|y_0|a|b|R|axis|pm"
)

IDENTIFIER = Type(f"an id of at most {MAX_NAME} characters without blanks, quotes, <>&$,;|\\", is_identifier)
IDENTIFIERS = Type("ids, separated by blanks", _are(is_identifier))
LABEL = Type(
    "at most 500 printable characters without $",
    lambda text: len(text) <= 500 and "$" not in text and (text.isprintable()),
)
WORD = Type(f"a word, or a number within ±{MAX_NUMBER:g}", _is_word)
WORDS = Type(f"words and numbers within ±{MAX_NUMBER:g}, separated by blanks or commas", _are(_is_word, " ,;"))
FINITE = number(-MAX_NUMBER, MAX_NUMBER)
NON_NEGATIVE = number(0, MAX_NUMBER)
PROBABILITY = number(0, 1)
SPEED = number(0, 500)  # m/s
LENGTH = number(0, 1e6)  # m
PER_HOUR = number(0, 1e5)
LANE_INDEX = whole(0, MAX_LANES - 1)
INDEX = whole(-1, 10_000)
REQUEST = whole(0, 4000)  # of a junction
TRAVELLERS = whole(0, 1_000_000)
CAPACITY = whole(0, 10_000)
COORDINATE = number(-MAX_COORDINATE, MAX_COORDINATE)
SHAPE = Type(
    "points x,y or x,y,z of at most 8 digits before the dot and no exponent, separated by blanks",
    lambda text: _SHAPE.fullmatch(text),
)
OPTIONAL_SHAPE = Type(SHAPE.wanted, lambda text: not text or _SHAPE.fullmatch(text))
BOUNDARY = _matching("four coordinates, separated by commas", rf"{_COORDINATE}(?:,{_COORDINATE}){{1,5}}")
BITS = _matching("at most 4000 of 0 and 1", "[01]{1,4000}")
SIGNALS = _matching("at most 4000 letters of rugGyYoOs", "[rRuUgGyYoOs]{1,4000}")
COLOUR = _matching("a colour", r"[\w#.,]{1,60}")
PERIOD = _matching("a number or exp(number)", r"\d{1,9}(?:\.\d{0,9})?|exp\(\d{1,6}(?:\.\d{0,9})?\)")
EMISSION = _matching(
    "a class of HBEFA, or another one that needs no file", r"(?!PHEM)[A-Za-z]\w{0,40}(?:/[\w-]{1,60})?"
)
PROJECTION = _matching(
    "! or - or a PROJ string without files", rf"[!.-]|(?: {{0,3}}\+(?:{_PROJECTION_KEYS})(?:=[\w.,+-]{{1,60}})?)+ ?"
)
PARAMETER_KEY = _matching("a short name that is no file's", r"(?!(?i:.*(?:file|output)))[A-Za-z][\w.:-]{0,99}")
LINK_LETTER = _matching("one of SUMO's letters", "[A-Za-z=-]")
DISTRIBUTION = _matching(
    "a number, or normc(mean, deviation, low, high)",
    r"\d{1,3}(?:\.\d{0,9})?|norm(?:c)?\( ?\d{1,3}(?:\.\d{0,9})?(?:, ?\d{1,3}(?:\.\d{0,9})?){1,3} ?\)",
)
SIGNAL_PROGRAM = _matching("static, actuated or delay_based", "static|actuated|delay_based")
