"""Attributes as numbers, texts, and expressions in the arithmetic of scenario documents.

Truth values are 1 and 0: `a and b` is their minimum, `a or b` their maximum, and `not a` is 1 less it.
Source: ASAM OpenSCENARIO XML 1.3, expressions.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, TypeVar

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedInput, VisitError

from risk_sac.config.base import Chosen
from risk_sac.config.values import FUNCTIONS, MOST_MAGNITUDE, Expression, term
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.openscenario.sources import Built, Unread, XmlElement

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
    """Translates the content of `${…}`; `name_of` maps parameters to document expressions.

    Raises:
      ConfigError: it is no expression, or too long, or a name is unknown.
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
    """Returns the number of an expression without names, else it; raises `ConfigError`."""
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


Text = str | Chosen[str]
T = TypeVar("T")
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d{1,3})?")
_REFERENCE = re.compile(r"\$([A-Za-z_][\w.:-]*)")
_LITERALS = {"true": 1.0, "false": 0.0, "INF": MOST_MAGNITUDE, "-INF": -MOST_MAGNITUDE}


@dataclass(frozen=True)
class Meaning:
    """Meaning of an attribute's value or a parameter."""

    text: str = ""
    """As it stands in the file; of a parameter its constant or default value."""
    expression: Expression | None = None
    """Number or arithmetic; None: it is a word."""
    words: Mapping[str, str] = field(default_factory=dict)
    """Word of the document → text that it stands for; empty: the text is constant."""
    by: Callable[[], str] | None = None
    """Returns the name of the document's parameter with these words."""


def literal(text: str) -> Meaning:
    """Returns the meaning of a value without parameters."""
    stripped = text.strip()
    if stripped in _LITERALS:
        return Meaning(stripped, _LITERALS[stripped])
    if NUMBER.fullmatch(stripped) and abs(float(stripped)) <= MOST_MAGNITUDE:
        return Meaning(stripped, float(stripped))
    return Meaning(text)


class NameScope:
    """Names that `$name` may stand for."""

    def __init__(self, find: Callable[[str], Meaning | None], names: Callable[[], list[str]]) -> None:
        """Prepares to look names up; all `names` are there to suggest one."""
        self._find, self._names = find, names

    def inner(self, own: Mapping[str, Meaning]) -> "NameScope":
        """Returns a scope with further names, which hide those of this one."""
        return NameScope(lambda name: own.get(name) or self._find(name), lambda: [*own, *self._names()])

    def name(self, name: str) -> Meaning:
        """Returns the meaning of a name; raises `ConfigError` for an unknown parameter."""
        if (meaning := self._find(name)) is None:
            remedy = did_you_mean(name, self._names()) or "declare it"
            raise ConfigError("", f"${name[:80]}, which is no parameter", "a declared parameter", remedy)
        return meaning

    def number(self, name: str) -> Expression:
        """Returns the number that a name stands for; raises `ConfigError`."""
        meaning = self.name(name)
        if meaning.expression is None:
            raise ConfigError("", f"${name[:80]}, which is no number", "a parameter with a number")
        return meaning.expression

    def meaning(self, text: str) -> Meaning:
        """Returns what a value stands for; raises `ConfigError` without a place."""
        stripped = text.strip()
        if stripped.startswith("${"):
            if not stripped.endswith("}"):
                raise ConfigError("", repr(text[:80]), "an expression between ${ and }")
            value = translated(stripped[2:-1], self.number)
            return Meaning(text_of(value), value)
        if match := _REFERENCE.fullmatch(stripped):
            return self.name(match[1])
        if "$" in stripped:
            raise ConfigError("", repr(text[:80]), "$name or ${expression} alone")
        return literal(text)


def text_of(value: Expression) -> str:
    """Returns a number as in a file: a whole one without fraction."""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


@dataclass(frozen=True)
class At:
    """An element, and the parameters that its values may name."""

    element: XmlElement
    scope: NameScope

    def _meaning(self, name: str) -> Meaning | None:
        raw = self.element.attribute(name)
        return None if raw is None else self.meant(name, raw)

    def meant(self, name: str, raw: str) -> Meaning:
        """Returns what a value of an attribute stands for here."""
        try:
            return self.scope.meaning(raw)
        except ConfigError as error:
            if error.field:
                raise
            raise self.refusal(f"{name}: {error.got}", error.expected, error.remedy) from None

    def _required(self, name: str) -> Meaning:
        if (meaning := self._meaning(name)) is None:
            raise self.refusal(f"no {name}", f"the attribute {name}")
        return meaning

    def number(self, name: str) -> Expression:
        """Returns a number or arithmetic; raises `ConfigError` if missing or a word."""
        meaning = self._required(name)
        if meaning.expression is None:
            raise self.refusal(f"{name}: {meaning.text[:80]!r}", "a number")
        return meaning.expression

    def combined(self, left: Expression, operator: str, right: Expression) -> Expression:
        """Joins two values with an operator; raises `ConfigError` if not a number."""
        try:
            return combined(left, operator, right)
        except ConfigError as error:
            raise self.refusal(error.got, error.expected, error.remedy) from None

    def number_or(self, name: str, default: T) -> Expression | T:
        """Returns a number or arithmetic, or the default where it is missing."""
        return default if name not in self.element.attributes else self.number(name)

    def text(self, name: str) -> Text:
        """Returns a text, or one for each word of a parameter."""
        meaning = self._required(name)
        if meaning.words and meaning.by is not None:
            return Chosen[str](by=meaning.by(), of=meaning.words)
        if isinstance(meaning.expression, str) and literal(meaning.text).expression is None:
            wanted = "a constant, or a parameter with a set of values"
            raise self.refusal(f"{name}: {meaning.expression[:80]!r}, which varies", wanted)
        return meaning.text

    def meaning(self, name: str) -> Meaning:
        """Returns whatever an attribute stands for."""
        return self._required(name)

    def constant(self, name: str, default: str | None = None) -> str:
        """Returns a text that no parameter varies."""
        if default is not None and name not in self.element.attributes:
            return default
        text = self.text(name)
        if isinstance(text, Chosen):
            raise self.refusal(f"{name}, which the parameter {text.by!r} varies", "a constant")
        return text

    def flag(self, name: str, default: bool | None = None) -> bool:
        """Returns whether an attribute is true."""
        if default is not None and name not in self.element.attributes:
            return default
        value = self.constant(name)
        if value not in ("true", "false", "1", "0"):
            raise self.refusal(f"{name}: {value[:80]!r}", "true or false")
        return value in ("true", "1")

    def one_of(self, name: str, table: Mapping[str, T], default: str | None = None) -> T:
        """Returns a word's value in a table; raises `ConfigError` for other words."""
        word = self.constant(name, default)
        if word not in table:
            got = f"{name}: {word[:80]!r}"
            raise self.refusal(got, f"one of {', '.join(table)}", did_you_mean(word, list(table)))
        return table[word]

    def all(self, *tags: str) -> list["At"]:
        """Returns the children of some names."""
        return [At(child, self.scope) for child in self.element.all(*tags)]

    def maybe(self, *tags: str) -> "At | None":
        """Returns the first child of some names, or None."""
        return next(iter(self.all(*tags)), None)

    def one(self, *tags: str) -> "At":
        """Returns the only child with such a tag; raises `ConfigError` otherwise."""
        children = self.all(*tags)
        if len(children) != 1:
            got = f"{len(children)} children <{'> or <'.join(tags[:8])}>" if children else self._children()
            raise self.refusal(got, f"one of <{'>, <'.join(tags)}>")
        return children[0]

    def only(self, what: str) -> "At":
        """Returns the only child of any tag; raises `ConfigError` otherwise."""
        children = self.element.children
        if len(children) != 1:
            raise self.refusal(f"{len(children)} {what}", "one")
        children[0].used = True
        return At(children[0], self.scope)

    def _children(self) -> str:
        tags = list(dict.fromkeys(child.tag for child in self.element.children))
        return f"only <{'>, <'.join(tags[:5])}>" if tags else "no child"

    @property
    def tag(self) -> str:
        """The element's name."""
        return self.element.tag

    def refusal(self, got: str, expected: str = "", remedy: str = "") -> ConfigError:
        """Returns the error of something that is wrong here."""
        return self.element.refusal(got, expected, remedy)

    def unknown(self, what: str, name: str, known: Iterable[str]) -> ConfigError:
        """Returns the error of a name that is not among the known."""
        names = list(known)
        wanted = f"one of {', '.join(names)}"[:500] if names else "none: there is none"
        return self.refusal(f"{what} {name[:80]!r}", wanted, did_you_mean(name, names))

    def unread(self, expected: str, effect: str) -> Unread:
        """Returns the error of something here that is not read."""
        return self.element.unread(expected, effect)

    def build(self, model: type[Built], **fields: Any) -> Built:
        """Makes a model of what was read here."""
        return self.element.build(model, **fields)
