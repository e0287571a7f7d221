"""The past-time STL that a requirement may be written in: grammar, types, windows, cost.

    formula    = disjunct ["implies" formula]
    disjunct   = conjunct {"or" conjunct}
    conjunct   = temporal {"and" temporal}
    temporal   = unary {"since" [window] unary}
    unary      = ("not" | "prev" | ("historically" | "once") [window]) unary | comparison
    comparison = sum [("<=" | "<" | ">=" | ">") sum]
    sum        = product {("+" | "-") product}
    product    = factor {("*" | "/") factor}
    factor     = number | signal | "-" factor | "abs" "(" sum ")" | "(" formula ")"
    window     = "[" number ["s" | "ms"] ("," | ":") number ["s" | "ms"] "]"      in seconds unless it says ms

Choice: formulas are parsed here and handed to rtamt fully parenthesised, with windows in samples, because
rtamt's own grammar reads `a - b + c` as `a - (b + c)`, `a/b` as one name and `p q` as `q` alone, drops
characters that it does not know, and names no position that helps.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from risk_sac.errors import FormulaError
from risk_sac.risk.lexer import Token, tokens
from risk_sac.risk.signals import SIGNALS

MAX_DEPTH = 40  # nested operators
MAX_COMPARISONS = 4000  # by the windows of one formula in one step, about 1 ms
MAX_MAGNITUDE = 1e9  # of any number in a formula, so that arithmetic stays finite

_BOUND = re.compile(r"\d{1,6}(\.\d{0,6})?")  # no exponents: 1e999999999 would fill memory as an exact fraction

_COMPARISONS = ("<=", "<", ">=", ">")
_RESERVED = {"historically", "once", "since", "prev", "not", "and", "or", "implies", "abs"}


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

    def __str__(self) -> str:
        """The formula as rtamt reads it, windows in samples."""
        if not self.children:
            return self.text
        operator = self.op + (f"[{self.window[0]},{self.window[1]}]" if self.window else "")
        operands = [f"({child})" for child in self.children]
        return operator + operands[0] if len(operands) == 1 else f"{operands[0]} {operator} {operands[1]}"


def parse(formula: str, step_s: float, horizon_steps: int) -> Node:
    """The formula's tree, checked for everything that monitoring it online needs.

    Args:
      formula: past-time STL over the published signals.
      step_s: time between two updates, s; window bounds are multiples of it.
      horizon_steps: steps of an episode; the formula may not look farther back.

    Raises:
      FormulaError: with position and reason.
    """
    parser = _Parser(tokens(formula), Fraction(str(step_s)), len(formula))
    node = parser.whole()
    back = memory(node)
    if back > horizon_steps:
        raise FormulaError(
            f"the windows reach {back * step_s:g} s back; an episode lasts {horizon_steps * step_s:g} s. Shorten them.",
            position=node.position,
        )
    work = comparisons(node)
    if work > MAX_COMPARISONS:
        raise FormulaError(
            f"the windows need {work} comparisons per step; wanted at most {MAX_COMPARISONS}. "
            "Shorten them: a timed since costs the square of its window.",
            position=node.position,
        )
    return node


def memory(node: Node) -> int:
    """Samples back that the value of a formula depends on; nested windows add up, unbounded ones count none."""
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
    """Names of the signals that a formula speaks about."""
    return {node.text} if node.op == "signal" else set[str]().union(*map(signals_of, node.children))


class _Parser:
    """Recursive descent over the grammar above; one method per rule."""

    def __init__(self, tokens: list[Token], step_s: Fraction, length: int) -> None:
        self.tokens = [*tokens, Token("end", "the end", length)]
        self.step_s = step_s
        self.index = 0
        self.nesting = 0

    @property
    def next(self) -> Token:
        return self.tokens[self.index]

    def take(self, *texts: str) -> Token | None:
        token = self.next
        if token.text not in texts:
            return None
        self.index += 1
        return token

    def expect(self, *texts: str) -> Token:
        token = self.take(*texts)
        if token is None:
            raise self.error(f"got {self.next.text!r}, wanted {' or '.join(map(repr, texts))}")
        return token

    def error(self, reason: str, position: int | None = None) -> FormulaError:
        position = self.next.position if position is None else position
        return FormulaError(f"column {position}: {reason}", position=position)

    def nested(self, rule: Callable[[], Node]) -> Node:
        """One level deeper; bounded before Python's stack is."""
        self.nesting += 1
        if self.nesting > MAX_DEPTH:
            raise self.error(f"more than {MAX_DEPTH} nested operators")
        node = rule()
        self.nesting -= 1
        return node

    def whole(self) -> Node:
        node = self.formula()
        if self.next.kind != "end":
            raise self.error(f"got {self.next.text!r}, wanted an operator or the end")
        self.require_truth(node)
        return node

    def formula(self) -> Node:
        left = self.disjunct()
        if token := self.take("implies"):
            return self.join(token, left, self.nested(self.formula))
        return left

    def disjunct(self) -> Node:
        left = self.conjunct()
        while token := self.take("or"):
            left = self.join(token, left, self.conjunct())
        return left

    def conjunct(self) -> Node:
        left = self.temporal()
        while token := self.take("and"):
            left = self.join(token, left, self.temporal())
        return left

    def temporal(self) -> Node:
        left = self.unary()
        while token := self.take("since"):
            window = self.window()
            left = self.join(token, left, self.unary(), window=window)
        return left

    def unary(self) -> Node:
        token = self.take("not", "prev", "historically", "once")
        if token is None:
            return self.comparison()
        window = self.window() if token.text in ("historically", "once") else None
        return self.join(token, self.nested(self.unary), window=window)

    def comparison(self) -> Node:
        left = self.sum()
        token = self.take(*_COMPARISONS)
        if token is None:
            return left
        node = self.join(token, left, self.sum())
        if self.next.text in _COMPARISONS:
            raise self.error("comparisons cannot be chained; write a <= x and x <= b")
        return node

    def sum(self) -> Node:
        left = self.product()
        while token := self.take("+", "-"):
            left = self.join(token, left, self.product())
        return left

    def product(self) -> Node:
        left = self.factor()
        while token := self.take("*", "/"):
            right = self.factor()
            if token.text == "/" and (right.op != "number" or float(right.text) == 0):
                raise self.error(
                    "only a number other than 0 can divide; multiply the inequality out instead", right.position
                )
            left = self.join(token, left, right)
        return left

    def factor(self) -> Node:
        token = self.next
        self.index += 1
        match token.kind, token.text:
            case "number", text:
                return Node("number", token.position, text=repr(float(text)), magnitude=self.bounded(token, text))
            case _, "-":
                zero = Node("number", token.position, text="0.0", magnitude=0.0)
                return self.join(token, zero, self.nested(self.factor))
            case _, "abs":
                self.expect("(")
                node = self.join(token, self.nested(self.sum))
                self.expect(")")
                return node
            case _, "(":
                node = self.nested(self.formula)
                self.expect(")")
                return node
            case "word", name if name in SIGNALS:
                info = SIGNALS[name]
                return Node("signal", token.position, text=name, magnitude=max(abs(info.low), abs(info.high)))
            case "word", name if name not in _RESERVED:
                raise self.error(
                    f"unknown signal {name!r}; the published ones are {', '.join(SIGNALS)}", token.position
                )
        raise self.error(f"got {token.text!r}, wanted a signal, a number or '('", token.position)

    def window(self) -> tuple[int, int] | None:
        start = self.take("[")
        if start is None:
            return None
        first = self.samples()
        self.expect(",", ":")
        last = self.samples()
        self.expect("]")
        if first > last:
            raise self.error(
                f"the window [{first * self.step_s}, {last * self.step_s}] s ends before it begins", start.position
            )
        return first, last

    def samples(self) -> int:
        token = self.next
        self.index += 1
        if token.kind != "number" or not _BOUND.fullmatch(token.text):
            raise self.error(f"got {token.text!r}, wanted a window bound in seconds such as 0.5", token.position)
        unit = self.take("s", "ms")
        seconds = Fraction(token.text) * (Fraction(1, 1000) if unit and unit.text == "ms" else 1)
        count = seconds / self.step_s
        if count.denominator != 1:
            step = float(self.step_s)
            raise self.error(f"the bound {float(seconds):g} s is no multiple of the {step:g} s step", token.position)
        return int(count)

    def join(self, token: Token, *children: Node, window: tuple[int, int] | None = None) -> Node:
        """The operator over its operands, which must be numbers or formulas as the operator asks."""
        arithmetic = token.text in ("+", "-", "*", "/", "abs")
        for child in children:
            if arithmetic or token.text in _COMPARISONS:
                if child.magnitude is None:
                    raise self.error(f"{token.text!r} wants numbers; got a formula", child.position)
            else:
                self.require_truth(child)
        depth = 1 + max(child.depth for child in children)
        if depth > MAX_DEPTH:
            raise self.error(f"more than {MAX_DEPTH} nested operators", token.position)
        position = token.position if len(children) == 1 else children[0].position
        magnitude = self.magnitude(token, children) if arithmetic else None
        return Node(token.text, position, children, window=window, magnitude=magnitude, depth=depth)

    def require_truth(self, node: Node) -> None:
        if node.magnitude is not None:
            raise self.error("got a number, wanted a comparison such as ttc_s >= 1.5", node.position)

    def magnitude(self, token: Token, children: tuple[Node, ...]) -> float:
        values = [child.magnitude or 0.0 for child in children]
        if token.text == "/":
            return self.bounded(token, values[0] / abs(float(children[1].text)))
        return self.bounded(token, math.prod(values) if token.text == "*" else sum(values))

    def bounded(self, token: Token, value: float | str) -> float:
        if float(value) > MAX_MAGNITUDE:
            raise self.error(f"the number may reach {float(value):g}; wanted at most {MAX_MAGNITUDE:g}", token.position)
        return float(value)
