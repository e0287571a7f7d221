"""Arithmetic over a scenario's parameters: `lead_gap_m + 4.6`, `max(6, 0.5 * ego_speed_mps)`."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Annotated

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedInput
from pydantic import AfterValidator, Field

from risk_sac.config.base import Interval
from risk_sac.errors import ConfigError, did_you_mean

LONGEST = 1000  # characters
MOST_DEPTH = 40  # nested operations
MOST_MAGNITUDE = 1e9
CONSTANTS = {"pi": math.pi}

_GRAMMAR = r"""
?start: sum
?comparison: sum COMPARE sum -> operation
?sum: product | sum SUM product -> operation
?product: factor | product PRODUCT factor -> operation
?factor: NUMBER -> number | NAME -> name | "-" factor -> negation | "+" factor
       | NAME "(" sum ("," sum)* ")" -> call | "(" sum ")"
COMPARE: "<=" | ">=" | "<" | ">"
SUM: "+" | "-"
PRODUCT: "*" | "/" | "%"
NAME: /[A-Za-z_]\w*/
NUMBER: /(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?/
%ignore /\s+/
"""


def _divided(a: float, b: float) -> float:
    if b == 0.0:
        raise ZeroDivisionError
    return a / b


def _remainder(a: float, b: float) -> float:
    """Remainder with the sign of the dividend."""
    if b == 0.0:
        raise ZeroDivisionError
    return math.fmod(a, b)


_BINARY: Mapping[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _divided,
    "%": _remainder,
    "<=": lambda a, b: float(a <= b),
    ">=": lambda a, b: float(a >= b),
    "<": lambda a, b: float(a < b),
    ">": lambda a, b: float(a > b),
}
FUNCTIONS: Mapping[str, tuple[int | None, Callable[..., float]]] = {  # number of arguments; None: two or more
    "pow": (2, math.pow),
    "sqrt": (1, math.sqrt),
    "sin": (1, math.sin),
    "cos": (1, math.cos),
    "tan": (1, math.tan),
    "asin": (1, math.asin),
    "acos": (1, math.acos),
    "atan": (1, math.atan),
    "abs": (1, abs),
    "sign": (1, lambda a: float((a > 0.0) - (a < 0.0))),
    "round": (1, lambda a: float(math.floor(a + 0.5))),  # a half is rounded up
    "floor": (1, lambda a: float(math.floor(a))),
    "ceil": (1, lambda a: float(math.ceil(a))),
    "min": (None, min),
    "max": (None, max),
}
DOMAINS = {"sqrt": (0.0, math.inf), "asin": (-1.0, 1.0), "acos": (-1.0, 1.0)}  # of what has no value elsewhere


@dataclass(frozen=True, slots=True)
class Term:
    """An operation, a name or a number of an expression."""

    op: str  # an operator, a function, "name" or "number"
    children: tuple["Term", ...] = ()
    name: str = ""
    number: float = 0.0
    depth: int = 1

    def value(self, of: Mapping[str, float]) -> float:
        """Returns the value for given names; raises `ConfigError` if undefined."""
        if self.op == "number":
            return self.number
        if self.op == "name":
            return of[self.name]
        values = [child.value(of) for child in self.children]
        try:
            value = _BINARY[self.op](*values) if self.op in _BINARY else FUNCTIONS[self.op][1](*values)
        except ZeroDivisionError:
            raise ConfigError("", f"a division by zero at {_shown(self.names(), of)}") from None
        except (ValueError, OverflowError):
            raise ConfigError("", f"{self.op} of {', '.join(f'{v:g}' for v in values)}", "a real number") from None
        if not abs(value) <= MOST_MAGNITUDE:
            raise ConfigError("", f"{value:g}", f"a number of at most {MOST_MAGNITUDE:g}")
        return value

    def names(self) -> set[str]:
        """All names in it."""
        return {self.name} if self.op == "name" else set().union(*(child.names() for child in self.children))

    def range(self, of: Mapping[str, Interval]) -> Interval:
        """Returns bounds of the value by interval arithmetic, possibly too wide.

        Raises:
          ConfigError: the value does not exist somewhere within the ranges, such as at a division by zero.
        """
        if self.op == "number":
            return Interval(low=self.number, high=self.number)
        if self.op == "name":
            return of[self.name]
        ranges = [child.range(of) for child in self.children]
        if self.op in "/%" and ranges[1].low <= 0.0 <= ranges[1].high:
            low, high = ranges[1].low, ranges[1].high
            raise ConfigError("", f"a division by {low:g} to {high:g}", "a divisor that is never 0 within the ranges")
        least, greatest = DOMAINS.get(self.op, (-math.inf, math.inf))
        if not least <= ranges[0].low <= ranges[0].high <= greatest:
            wanted = "0 or more" if self.op == "sqrt" else "-1 to 1"
            raise ConfigError("", f"{self.op} of {ranges[0].low:g} to {ranges[0].high:g}", wanted)
        if self.op in ("sin", "cos"):
            return Interval(low=-1.0, high=1.0)
        if self.op == "tan" and not (-math.pi / 2 < ranges[0].low and ranges[0].high < math.pi / 2):
            return Interval(low=-MOST_MAGNITUDE, high=MOST_MAGNITUDE)
        if self.op == "%":
            most = max(abs(ranges[1].low), abs(ranges[1].high))
            return Interval(low=-most if ranges[0].low < 0.0 else 0.0, high=most if ranges[0].high > 0.0 else 0.0)
        if self.op in ("min", "max"):
            ends = [[bound.low for bound in ranges], [bound.high for bound in ranges]]
            low, high = (FUNCTIONS[self.op][1](*end) for end in ends)
            return Interval(low=low, high=high)
        corners = product(*((bound.low, bound.high) for bound in ranges))
        leaf = Term(self.op, tuple(Term("name", name=str(i)) for i in range(len(ranges))))
        values = [leaf.value({str(i): value for i, value in enumerate(corner)}) for corner in corners]
        if self.op == "abs" and ranges[0].low <= 0.0 <= ranges[0].high:
            values.append(0.0)
        return Interval(low=min(values), high=max(values))


def _shown(names: Collection[str], of: Mapping[str, float]) -> str:
    return ", ".join(f"{name} = {of[name]:g}" for name in sorted(names) if name in of) or "any point"


@v_args(inline=True)
class _Terms(Transformer[Token, Term]):
    def number(self, token: Token) -> Term:
        value = float(token)
        if not abs(value) <= MOST_MAGNITUDE:
            raise ConfigError("", str(token), f"a number of at most {MOST_MAGNITUDE:g}")
        return Term("number", number=value)

    def name(self, token: Token) -> Term:
        if token in FUNCTIONS:
            raise ConfigError("", f"{token} without arguments", f"{token}(…)")
        return Term("number", number=CONSTANTS[token]) if token in CONSTANTS else Term("name", name=str(token))

    def negation(self, term: Term) -> Term:
        if term.op == "number":
            return Term("number", number=-term.number)
        return _operation("-", Term("number", number=0.0), term)

    def operation(self, left: Term, operator: Token, right: Term) -> Term:
        return _operation(str(operator), left, right)

    def call(self, function: Token, *arguments: Term) -> Term:
        if function not in FUNCTIONS:
            remedy = did_you_mean(str(function), list(FUNCTIONS))
            raise ConfigError("", f"the function {function}", f"one of {', '.join(FUNCTIONS)}", remedy)
        count = FUNCTIONS[function][0]
        if len(arguments) != count if count is not None else len(arguments) < 2:
            raise ConfigError("", f"{function} of {len(arguments)} values", f"{count or 'two or more'}")
        return _operation(str(function), *arguments)


def _operation(op: str, *children: Term) -> Term:
    depth = 1 + max(child.depth for child in children)
    if depth > MOST_DEPTH:
        raise ConfigError("", f"{depth} nested operations", f"at most {MOST_DEPTH}")
    return Term(op, children, depth=depth)


@cache
def _parser(start: str) -> Lark:
    return Lark(_GRAMMAR, parser="lalr", start=start, transformer=_Terms())


def _parsed(text: str, start: str, kind: str, expected: str) -> Term:
    if len(text) > LONGEST:
        raise ConfigError("", f"{len(text)} characters", f"at most {LONGEST}")
    try:
        return _parser(start).parse(text)  # type: ignore[return-value] # what the transformer makes
    except UnexpectedInput as error:
        where = f", which is no {kind} from column {error.column} on" if error.column > 0 else ", which is incomplete"
        raise ConfigError("", f"{text!r}{where}", expected) from error


@cache
def term(expression: "float | str") -> Term:
    """Parses an expression or wraps a number; `ConfigError` unless arithmetic."""
    if isinstance(expression, str):
        wanted = f"arithmetic over parameters: + - * / % and {', '.join(FUNCTIONS)}"
        return _parsed(expression, "start", "arithmetic", wanted)
    return Term("number", number=float(expression))


@cache
def comparison(text: str) -> Term:
    """Parses a comparison, of value 1 or 0; raises `ConfigError` for others."""
    return _parsed(text, "comparison", "comparison", "a comparison such as `lead_gap_m >= 2 * ego_speed_mps`")


def _checked(expression: float | str) -> float | str:
    term(expression)
    return expression


def _compared(text: str) -> str:
    comparison(text)
    return text


ARITHMETIC = AfterValidator(_checked)  # what tells an expression from other fields of a model
Expression = Annotated[
    Annotated[float, Field(ge=-MOST_MAGNITUDE, le=MOST_MAGNITUDE)] | Annotated[str, Field(min_length=1)], ARITHMETIC
]
"""A number, or arithmetic over parameters: `+ - * / %`, the functions of `FUNCTIONS`, and pi."""
Comparison = Annotated[str, Field(min_length=1), AfterValidator(_compared)]
"""Two expressions with `<=`, `<`, `>=` or `>` between them."""
