"""Turns expressions of OpenSCENARIO, `${$a * 2}`, into arithmetic of scenario documents.

Truth values are 1 and 0: `a and b` is their minimum, `a or b` their maximum, and `not a` is 1 less it.
Source: ASAM OpenSCENARIO XML 1.3, expressions.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedInput, VisitError

from risk_sac.config.values import FUNCTIONS, Expression, term
from risk_sac.errors import ConfigError, did_you_mean

LONGEST = 2_000  # characters of an expression in a file
CONSTANTS = {"pi": "pi", "e": repr(math.e), "true": "1", "false": "0"}
_GRAMMAR = r"""
?start: either
?either: both | either "or" both -> disjunction
?both: sum | both "and" sum -> conjunction
?sum: product | sum SUM product -> sum
?product: unary | product PRODUCT unary -> product
?unary: atom | "-" unary -> minus | "+" unary | "not" unary -> negation
?atom: NUMBER -> number | "$" NAME -> parameter | NAME -> constant
     | NAME "(" either ("," either)* ")" -> call | "(" either ")"
SUM: "+" | "-"
PRODUCT: "*" | "/" | "%"
NAME: /[A-Za-z_]\w*/
NUMBER: /(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?/
%ignore /\s+/
"""
_SUM, _PRODUCT, _ATOM = 1, 2, 3  # how tightly a piece of text holds together


class _Code(NamedTuple):
    text: str
    holds: int = _ATOM

    def within(self, least: int) -> str:
        """The text, in parentheses if it holds together less tightly."""
        return self.text if self.holds >= least else f"({self.text})"


def translated(text: str, name_of: Callable[[str], Expression]) -> Expression:
    """Translates what stands between `${` and `}`.

    Args:
      text: the expression.
      name_of: what a parameter's name stands for in the document; raises `ConfigError`.

    Raises:
      ConfigError: it is no expression, or too long.
    """
    if len(text) > LONGEST:
        raise ConfigError("", f"an expression of {len(text)} characters", f"at most {LONGEST}")
    try:
        tree = _parser().parse(text)
        code: _Code = _Coder(name_of).transform(tree)
    except UnexpectedInput as error:
        where = f", which is none from column {error.column} on" if error.column > 0 else ", which is incomplete"
        wanted = f"numbers, $parameters, + - * / %, not, and, or, and {', '.join(_known())}"
        raise ConfigError("", f"the expression {text[:80]!r}{where}", wanted) from None
    except VisitError as error:
        if isinstance(error.orig_exc, ConfigError):
            raise error.orig_exc from None
        raise
    except RecursionError:
        raise ConfigError("", "an expression that is nested too deep", "fewer parentheses") from None
    return simplest(code.text)


def simplest(text: str) -> Expression:
    """Returns the number if an expression has no names, else the expression; raises `ConfigError`."""
    of_text = term(text)
    return text if of_text.names() else of_text.value({})


def _known() -> list[str]:
    return [*FUNCTIONS, *CONSTANTS]


@cache
def _parser() -> Lark:
    return Lark(_GRAMMAR, parser="lalr")


@v_args(inline=True)
class _Coder(Transformer[Token, _Code]):
    """Writes each part of an expression as text of a document."""

    def __init__(self, name_of: Callable[[str], Expression]) -> None:
        super().__init__()
        self._name_of = name_of

    def number(self, token: Token) -> _Code:
        return _Code(str(token))

    def parameter(self, name: Token) -> _Code:
        return coded(self._name_of(str(name)))

    def constant(self, name: Token) -> _Code:
        if name not in CONSTANTS:
            remedy = did_you_mean(str(name), _known()) or f"write ${name} for a parameter"
            raise ConfigError("", f"{str(name)!r} in an expression", f"one of {', '.join(CONSTANTS)}", remedy)
        return _Code(CONSTANTS[name])

    def call(self, name: Token, *arguments: _Code) -> _Code:
        if name not in FUNCTIONS:
            remedy = did_you_mean(str(name), list(FUNCTIONS))
            raise ConfigError("", f"the function {str(name)!r}", f"one of {', '.join(FUNCTIONS)}", remedy)
        return _Code(f"{name}({', '.join(argument.text for argument in arguments)})")

    def sum(self, left: _Code, operator: Token, right: _Code) -> _Code:
        return _Code(f"{left.within(_SUM)} {operator} {right.within(_PRODUCT)}", _SUM)

    def product(self, left: _Code, operator: Token, right: _Code) -> _Code:
        return _Code(f"{left.within(_PRODUCT)} {operator} {right.within(_ATOM)}", _PRODUCT)

    def minus(self, value: _Code) -> _Code:
        return _Code(f"-{value.within(_ATOM)}", _PRODUCT)

    def negation(self, value: _Code) -> _Code:
        return _Code(f"1 - {value.within(_PRODUCT)}", _SUM)

    def conjunction(self, left: _Code, right: _Code) -> _Code:
        return _Code(f"min({left.text}, {right.text})")

    def disjunction(self, left: _Code, right: _Code) -> _Code:
        return _Code(f"max({left.text}, {right.text})")


def coded(value: Expression) -> _Code:
    """Returns the text of a value, and how tightly it holds together."""
    if isinstance(value, str):
        return _Code(value) if value.isidentifier() else _Code(value, 0)
    return _Code(repr(value) if value >= 0 else f"({value!r})")


def combined(left: Expression, operator: str, right: Expression) -> Expression:
    """Returns two values with an operator between them."""
    return simplest(f"{coded(left).within(_ATOM)} {operator} {coded(right).within(_ATOM)}")
