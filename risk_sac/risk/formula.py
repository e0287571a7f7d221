"""Past-time STL of a requirement: grammar, types, windows and cost of monitoring.

Choice: formulas are parsed here, not by rtamt. Its grammar reads `a - b + c` as `a - (b + c)`, `a/b` as one name and
`p q` as `q` alone, drops unknown characters, and gives no useful position.
"""

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from risk_sac.errors import FormulaError
from risk_sac.risk.requirements import SIGNALS

MAX_DEPTH = 40  # nested operators
MAX_COMPARISONS = 4000  # by the windows of one formula in one step, about 1 ms
MAX_MAGNITUDE = 1e9  # of any number in a formula, so that arithmetic stays finite

# Window bounds are in seconds unless they say ms.
_GRAMMAR = r"""
?formula:    disjunct | disjunct IMPLIES formula                       -> operation
?disjunct:   conjunct | disjunct OR conjunct                           -> operation
?conjunct:   temporal | conjunct AND temporal                          -> operation
?temporal:   unary | temporal SINCE window? unary                      -> operation
?unary:      comparison | (NOT | PREV) unary                           -> operation
                        | (HISTORICALLY | ONCE) window? unary          -> operation
?comparison: sum | sum COMPARISON sum                                  -> operation
?sum:        product | sum (PLUS | MINUS) product                      -> operation
?product:    factor | product (TIMES | OVER) factor                    -> operation
?factor:     NUMBER -> number | WORD -> signal | MINUS factor          -> negation
                    | ABS "(" sum ")" -> operation | "(" formula ")"
window:      LSQB bound _SEPARATOR bound "]"
bound:       NUMBER UNIT?

COMPARISON.2: /<->|<=|>=|!==?|==?|<|>/
IMPLIES.1: /implies\b|->/
OR.1: /or\b|\|\|?/
AND.1: /and\b|&&?/
NOT.1: /not\b|!/
SINCE.1: /(since|S)\b/
PREV.1: /(prev|Y)\b/
HISTORICALLY.1: /(historically|H)\b/
ONCE.1: /(once|O)\b/
ABS.1: /abs\b/
UNIT.1: /m?s\b/
WORD: /[A-Za-z_]\w*/
NUMBER: /(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?/
_SEPARATOR: /[,:]/
PLUS: "+"
MINUS: "-"
TIMES: "*"
OVER: "/"
LSQB: "["
%ignore /\s+/
"""
ARITHMETIC = ("+", "-", "*", "/", "abs")
COMPARISONS = ("<=", "<", ">=", ">")
_EXPECTED = {
    "WORD": "a signal",
    "NUMBER": "a number",
    "LPAR": "'('",
    "AND": "an operator",
    "_SEPARATOR": "',' or ':'",
    "RPAR": "')'",
    "RSQB": "']'",
    "$END": "the end",
}
_BOUND = re.compile(r"\d{1,6}(\.\d{0,6})?")  # no exponents: 1e999999999 would fill memory as an exact fraction
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
class Node:
    """One operator, signal or number of a formula."""

    op: str  # operator, "signal" or "number"
    position: int  # 0-based column
    children: tuple["Node", ...] = ()
    text: str = ""  # of a signal or number
    window: tuple[int, int] | None = None  # samples back, first to last
    magnitude: float | None = None  # largest absolute value; None for a formula, which is true or false
    depth: int = 1


def parse(formula: str, step_s: float, horizon_steps: int) -> Node:
    """Parses a formula and checks that it can be monitored online.

    Args:
      formula: past-time STL over the published signals.
      step_s: time between two updates, s; window bounds are multiples of it.
      horizon_steps: steps of an episode; the formula may not look farther back.

    Raises:
      FormulaError: with position and reason.
    """
    try:
        node: Node = _parser(step_s).parse(formula)  # type: ignore[assignment] # what the transformer makes
    except UnexpectedCharacters as error:
        raise FormulaError(f"unknown character {error.char!r}", position=error.pos_in_stream) from error
    except UnexpectedToken as error:
        raise _unexpected(error, formula) from error
    _require_truth(node)
    back = memory(node)
    if back > horizon_steps:
        raise FormulaError(
            f"windows that reach {back * step_s:g} s back",
            f"at most the {horizon_steps * step_s:g} s of an episode",
            position=node.position,
        )
    work = comparisons(node)
    if work > MAX_COMPARISONS:
        raise FormulaError(
            f"windows that need {work} comparisons per step",
            f"at most {MAX_COMPARISONS}",
            "shorten them: a timed since costs the square of its window",
            position=node.position,
        )
    return node


def memory(node: Node) -> int:
    """Counts the past samples that a formula needs; unbounded windows count none.

    Nested windows add up.
    """
    own = node.window[1] if node.window else int(node.op == "prev")
    return own + max((memory(child) for child in node.children), default=0)


def comparisons(node: Node) -> int:
    """Sample comparisons per step that rtamt's windows make."""
    own = 0
    if node.window:
        first, last = node.window
        own = last - first + 1 if node.op != "since" else sum(last - i for i in range(last - first + 1))
    return own + sum(comparisons(child) for child in node.children)


def signals_of(node: Node) -> set[str]:
    """Names of the signals in a formula."""
    return {node.text} if node.op == "signal" else set[str]().union(*map(signals_of, node.children))


@cache
def _parser(step_s: float) -> Lark:
    """Parser whose windows are in steps of `step_s`."""
    return Lark(
        _GRAMMAR,
        start="formula",
        parser="lalr",
        lexer="basic",
        transformer=_Nodes(Fraction(str(step_s))),
        lexer_callbacks={"WORD": _supported, "COMPARISON": _supported},
        g_regex_flags=re.ASCII,
    )


def _supported(token: Token) -> Token:
    """Refuses future operators and those without a faithful robustness, with the rewrite."""
    if token in _PAST_OF:
        raise FormulaError(
            f"{token.value!r}, which looks into the future, unknown to an online monitor",
            f"the past-time operator {_PAST_OF[token]!r}",
            position=token.start_pos,
        )
    if token in _REWRITES:
        got, remedy = f"{token.value!r} is not supported", f"use {_REWRITES[token]}"
        raise FormulaError(got, remedy=remedy, position=token.start_pos)
    return token


def _unexpected(error: UnexpectedToken, formula: str) -> FormulaError:
    """Says what was found and what was expected."""
    accepts = error.accepts
    if error.token.type == "COMPARISON" and "AND" in accepts:
        return FormulaError(
            "comparisons cannot be chained", remedy="write a <= x and x <= b", position=error.token.start_pos
        )
    at_end = error.token.type == "$END"
    got, position = ("the end", len(formula)) if at_end else (error.token.value, error.token.start_pos)
    if accepts == {"NUMBER"}:
        wanted = "a window bound in seconds such as 0.5"
    else:
        words = [word for terminal, word in _EXPECTED.items() if terminal in accepts] or ["the end"]
        wanted = " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))
    return FormulaError(repr(got), wanted, position=position)


@v_args(inline=True)
class _Nodes(Transformer[Token, Node]):
    """Transformer that builds the tree and checks type and range of nodes."""

    def __init__(self, step_s: Fraction) -> None:
        super().__init__()
        self._step_s = step_s

    def number(self, token: Token) -> Node:
        value = _bounded(token, float(token))
        return Node("number", _at(token), text=repr(value), magnitude=value)

    def signal(self, token: Token) -> Node:
        info = SIGNALS.get(token)
        if info is None:
            raise FormulaError(
                f"the unknown signal {token.value!r}", f"one of {', '.join(SIGNALS)}", position=_at(token)
            )
        return Node("signal", _at(token), text=str(token), magnitude=max(abs(info.low), abs(info.high)))

    def negation(self, token: Token, operand: Node) -> Node:
        zero = Node("number", _at(token), text="0.0", magnitude=0.0)
        return self.operation(zero, token, operand)

    def bound(self, token: Token, unit: str = "s") -> int:
        if not _BOUND.fullmatch(token):
            raise FormulaError(repr(token.value), "a window bound in seconds such as 0.5", position=_at(token))
        seconds = Fraction(token) * (Fraction(1, 1000) if unit == "ms" else 1)
        steps = seconds / self._step_s
        if steps.denominator != 1:
            step = float(self._step_s)
            raise FormulaError(
                f"the bound {float(seconds):g} s is no multiple of the {step:g} s step", position=_at(token)
            )
        return int(steps)

    def window(self, bracket: Token, first: int, last: int) -> tuple[int, int]:
        if first > last:
            start_s, end_s = float(first * self._step_s), float(last * self._step_s)
            raise FormulaError(f"the window [{start_s:g}, {end_s:g}] s ends before it begins", position=_at(bracket))
        return first, last

    def operation(self, *parts: Token | tuple[int, int] | Node) -> Node:
        """An operator with its operands, and its window if it has one."""
        [token] = [part for part in parts if isinstance(part, Token)]
        operands = tuple(part for part in parts if isinstance(part, Node))
        window = next((part for part in parts if isinstance(part, tuple)), None)
        op = str(token) if token in (*ARITHMETIC, *COMPARISONS) else token.type.lower()
        for operand in operands:
            if op not in (*ARITHMETIC, *COMPARISONS):
                _require_truth(operand)
            elif operand.magnitude is None:
                raise FormulaError("a formula", f"numbers around {op!r}", position=operand.position)
        depth = 1 + max(operand.depth for operand in operands)
        if depth > MAX_DEPTH:
            raise FormulaError(f"more than {MAX_DEPTH} nested operators", position=_at(token))
        position = _at(token) if len(operands) == 1 else operands[0].position
        magnitude = _magnitude(token, operands) if op in ARITHMETIC else None
        return Node(op, position, operands, window=window, magnitude=magnitude, depth=depth)


def _at(token: Token) -> int:
    return token.start_pos or 0


def _require_truth(node: Node) -> None:
    if node.magnitude is not None:
        raise FormulaError("a number", "a comparison such as ttc_s >= 1.5", position=node.position)


def _magnitude(token: Token, operands: tuple[Node, ...]) -> float:
    values = [operand.magnitude or 0.0 for operand in operands]
    if token == "/":
        divisor = operands[1]
        if divisor.op != "number" or float(divisor.text) == 0:
            raise FormulaError(
                "only a number other than 0 can divide",
                remedy="multiply the inequality out instead",
                position=divisor.position,
            )
        return _bounded(token, values[0] / float(divisor.text))
    return _bounded(token, math.prod(values) if token == "*" else sum(values))


def _bounded(token: Token, value: float) -> float:
    if value > MAX_MAGNITUDE:
        raise FormulaError(f"a number that may reach {value:g}", f"at most {MAX_MAGNITUDE:g}", position=_at(token))
    return value
