"""The words of a formula, their other spellings, and what to write instead of those that cannot be monitored."""

import re
from dataclasses import dataclass

from risk_sac.errors import FormulaError

_TOKEN = re.compile(
    r"(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)|(?P<word>[A-Za-z_]\w*)"
    r"|(?P<symbol><->|->|<=|>=|!==|!=|==|&&|\|\||[-+*/()\[\],:<>!&|=])|(?P<space>\s+)|(?P<unknown>.)",
    re.ASCII,
)
_ALIASES = {
    "H": "historically",
    "O": "once",
    "S": "since",
    "Y": "prev",
    "!": "not",
    "&": "and",
    "&&": "and",
    "|": "or",
    "||": "or",
    "->": "implies",
}
_PAST_OF = {
    **dict.fromkeys(("always", "G"), "historically"),
    **dict.fromkeys(("eventually", "F"), "once"),
    **dict.fromkeys(("until", "U", "unless", "W"), "since"),
    **dict.fromkeys(("next", "X", "s_next", "sX"), "prev"),
}
# rtamt's robustness of iff and of equalities has the wrong sign or none: a true `p iff q` can come out negative.
_REWRITES = {
    **dict.fromkeys(("iff", "<->"), "(p implies q) and (q implies p)"),
    "xor": "(p or q) and not (p and q)",
    **dict.fromkeys(("==", "="), "abs(x - c) <= tolerance"),
    **dict.fromkeys(("!=", "!=="), "abs(x - c) >= tolerance"),
    "rise": "p and not prev p",
    "fall": "not p and prev p",
    **dict.fromkeys(("s_prev", "sY"), "prev"),
    **dict.fromkeys(("sqrt", "exp", "pow"), "+, -, *, / by a number, and abs"),
    **dict.fromkeys(("true", "false"), "a comparison"),
}


@dataclass(frozen=True, slots=True)
class Token:
    """One word, number or symbol, its spelling made canonical."""

    kind: str
    text: str
    position: int


def tokens(formula: str) -> list[Token]:
    """The words of a formula in order.

    Raises:
      FormulaError: an unknown character, a future operator or one without a faithful robustness, with the rewrite.
    """
    found = []
    for match in _TOKEN.finditer(formula):
        kind, text, position = str(match.lastgroup), match.group(), match.start()
        if kind == "unknown":
            raise FormulaError(f"column {position}: unknown character {text!r}", position=position)
        if text in _PAST_OF:
            raise FormulaError(
                f"column {position}: {text!r} looks into the future, which an online monitor does not know; "
                f"use the past-time operator {_PAST_OF[text]!r}",
                position=position,
            )
        if text in _REWRITES:
            raise FormulaError(
                f"column {position}: {text!r} is not supported; use {_REWRITES[text]}", position=position
            )
        if kind != "space":
            found.append(Token(kind, _ALIASES.get(text, text), position))
    return found
