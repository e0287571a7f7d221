"""Parameters of a scenario file, and what they become in the document.

A parameter becomes a constant, arithmetic over others, a range, rows or words. A text that does not vary is left out of
the document, where it stands for itself.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

from risk_sac.config.base import Word
from risk_sac.config.distribution import WeightsLaw
from risk_sac.config.scenario import AllOf, AnyOf, Constraint, ScenarioParameter
from risk_sac.config.values import CONSTANTS, FUNCTIONS, comparison, term
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.openscenario.scope import At, Meaning, NameScope, coded, literal
from risk_sac.openscenario.sources import XmlElement

TEXTS = ("string", "dateTime")
WHOLE = ("int", "integer", "unsignedInt", "unsignedShort")
TYPES = ("double", *WHOLE, "boolean", *TEXTS)
MOST = 90  # parameters of a file; a document has at most 100
_DEEPEST = 40  # parameters that each name the next one
_LONGEST_WORD = 64


@dataclass(frozen=True)
class Varied:
    """Values that a variation file gives parameters that vary together."""

    name: str
    """Of the axis in the document."""
    place: XmlElement
    parameter: ScenarioParameter | None = None
    """A range; else there are rows."""
    rows: tuple[Mapping[str, str], ...] = ()
    """Name → text, of each row."""
    weights: WeightsLaw | None = None
    """Of the rows."""

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that it varies."""
        return tuple(self.rows[0]) if self.rows else (self.name,)


@dataclass(frozen=True)
class Declared:
    """Declaration of a parameter."""

    at: At
    name: str
    kind: str
    value: str


class Parameters:
    """All parameters of a scenario file."""

    def __init__(self, declarations: Sequence[At], varied: Sequence[Varied] = ()) -> None:
        """Reads elements `ParameterDeclaration`, and what a variation file says of them.

        Raises:
          ConfigError: one has no value, is there twice, or does not exist.
        """
        self.declared: dict[str, Declared] = {}
        self.scope = NameScope(self.meaning, lambda: list(self.declared))
        self._parts = tuple(part for part in varied if len(part.rows) != 1)
        self.varied = {name: part for part in self._parts for name in part.names}
        fixed = {name: text for part in varied if len(part.rows) == 1 for name, text in part.rows[0].items()}
        self._open = list[str]()
        self._meanings = dict[str, Meaning | None]()
        self._as_words = set[str]()  # numbers that choose texts, such as a road's id, too
        for at in declarations:
            declared = read_declaration(at)
            if declared.name in self.declared:
                raise at.refusal(f"the parameter {declared.name!r} once more", "each name once")
            value = fixed.get(declared.name, declared.value)
            self.declared[declared.name] = replace(declared, at=At(at.element, self.scope), value=value)
        if len(self.declared) > MOST:
            raise declarations[0].refusal(f"{len(self.declared)} parameters", f"at most {MOST}")
        for part in varied:
            for name in part.names:
                if name not in self.declared:
                    known = ", ".join(list(self.declared)[:20]) or "none"
                    remedy = did_you_mean(name, self.declared)
                    raise part.place.refusal(f"the parameter {name[:80]!r}", f"a declared one: {known}", remedy)

    def meaning(self, name: str) -> Meaning | None:
        """Returns the meaning of a parameter's name; None if there is none."""
        if name not in self.declared:
            return None
        if name not in self._meanings:
            self._meanings[name] = self._read(self.declared[name])
        return self._meanings[name]

    def default(self, name: str) -> Meaning:
        """Returns what the declared value of a parameter stands for."""
        declared = self.declared[name]
        if name in self._open or len(self._open) >= _DEEPEST:
            chain = " → ".join([*self._open[-5:], name])
            raise declared.at.refusal(f"parameters that name each other: {chain}", "a chain that ends at a number")
        self._open.append(name)
        try:
            meaning = declared.at.meant("value", declared.value)
        finally:
            self._open.pop()
        if meaning.expression is None and declared.kind not in TEXTS:
            raise declared.at.refusal(f"value: {meaning.text[:80]!r}", f"a value of type {declared.kind}")
        return meaning

    def _read(self, declared: Declared) -> Meaning:
        name = declared.name
        if (part := self.varied.get(name)) is None:
            default = self.default(name)
            if default.expression is None or (declared.kind in TEXTS and isinstance(default.expression, float)):
                return default  # a constant text, such as "car" or "-4"
            return Meaning(default.text, name)
        if not part.rows:
            return Meaning(name, name)
        texts = dict.fromkeys(row[name] for row in part.rows)
        words = {word: text for text, word in words_of(texts).items()}
        if all(literal(text).expression is not None for text in texts):
            return Meaning(name, name, words, partial(self._word_column, name))
        return Meaning(name, None, words, lambda: name)

    def _word_column(self, name: str) -> str:
        self._as_words.add(name)
        return f"{name[: _LONGEST_WORD - 5]}_word"

    def word(self, name: str, text: str) -> str:
        """Returns the word for a parameter's text, or one for other texts."""
        meaning = self.meaning(name)
        words = {text: word for word, text in (meaning.words if meaning else {}).items()}
        return words.get(text) or f"{words_of([text])[text][: _LONGEST_WORD - 6]}_other"

    def is_number(self, name: str) -> bool:
        """Whether a parameter is a number of the document."""
        meaning = self.meaning(name)
        return meaning is not None and meaning.expression == name

    @cached_property
    def constants(self) -> Mapping[str, float]:
        """Numbers of the document that do not vary."""
        numbers = dict[str, float]()
        for name in self._ordered():
            value = self.default(name).expression
            if value is not None and term(value).names() <= numbers.keys():
                try:
                    numbers[name] = term(value).value(numbers)
                except ConfigError as error:
                    where = self.declared[name].at
                    raise where.refusal(f"value: {error.got}", error.expected or "a number") from None
        return numbers

    @property
    def texts(self) -> Mapping[str, str]:
        """Constant texts, which are left out of the document."""
        meanings = {name: self.meaning(name) for name in self.declared if name not in self.varied}
        return {name: one.text for name, one in meanings.items() if one is not None and not self.is_number(name)}

    def _ordered(self) -> list[str]:
        """Numbers that no variation gives, each after those that it names."""
        ordered = dict[str, None]()

        def add(name: str) -> None:
            if name in ordered or name in self.varied or not self.is_number(name):
                return
            value = self.default(name).expression
            for other in sorted(term(value).names(), key=list(self.declared).index) if value is not None else ():
                add(other)
            ordered[name] = None

        for name in self.declared:
            add(name)
        return list(ordered)

    def document(self) -> dict[str, ScenarioParameter]:
        """Returns the document's parameters: first those that vary, then by dependency."""
        parameters = dict[str, ScenarioParameter]()
        for part in self._parts:
            if part.parameter is not None:
                parameters[part.name] = part.parameter
            else:
                name = part.name
                while len(part.names) > 1 and (name in self.declared or name in parameters):
                    name = f"{name}_"
                parameters[name] = self._rows(part)
        for name in self._ordered():
            value = self.default(name).expression
            parameters[name] = self.declared[name].at.build(ScenarioParameter, value=value)
        return parameters

    def _rows(self, part: Varied) -> ScenarioParameter:
        """Returns rows of numbers and words, or one name's words alone."""
        if part.names == (part.name,) and not self.is_number(part.name):
            words = tuple(self.word(part.name, row[part.name]) for row in part.rows)
            return part.place.build(ScenarioParameter, words=words, distribution=part.weights)
        rows = tuple(self._row(row) for row in part.rows)
        return part.place.build(ScenarioParameter, rows=rows, distribution=part.weights)

    def _row(self, texts: Mapping[str, str]) -> dict[Word, float | Word]:
        row = dict[Word, float | Word]()
        for name, text in texts.items():
            value = literal(text).expression
            if self.is_number(name) and isinstance(value, float):
                row[name] = value
            else:
                row[name] = self.word(name, text)
            if name in self._as_words:
                row[self._word_column(name)] = self.word(name, text)
        return row


def read_declaration(at: At) -> Declared:
    """Reads a `ParameterDeclaration`; raises `ConfigError` for its name, type or value."""
    name, kind = at.element.attribute("name") or "", at.element.attribute("parameterType") or ""
    value = at.element.attribute("value")
    if not re.fullmatch(rf"[A-Za-z_]\w{{0,{_LONGEST_WORD - 1}}}", name, re.ASCII):
        raise at.refusal(f"the name {name[:80]!r}", f"letters, digits and _, at most {_LONGEST_WORD}")
    if name in FUNCTIONS or name in CONSTANTS:
        raise at.refusal(f"the name {name!r}, which is that of a function or constant", "another name", "rename it")
    if kind not in TYPES:
        raise at.refusal(f"parameterType {kind[:80]!r}", f"one of {', '.join(TYPES)}")
    if value is None:
        raise at.refusal(f"the parameter {name!r} without a value", "the attribute value")
    return Declared(at, name, kind, value)


def words_of(texts: Iterable[str]) -> dict[str, str]:
    """Returns a unique word for each text, for a path its stem."""
    words = dict[str, str]()
    for text in texts:
        name = re.sub(r"^.*[/\\]|\.xodr$", "", text) or "none"
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name.replace("-", "minus_", 1) if name[:1] == "-" else name)
        word = (f"_{plain}" if plain[0].isdigit() else plain)[: _LONGEST_WORD - 4]
        number, unique = 2, word
        while unique in words.values():
            unique, number = f"{word}_{number}", number + 1
        words[text] = unique
    return words


_SIGNS: Mapping[str, tuple[str, ...]] = {
    "greaterThan": (">",),
    "greaterOrEqual": (">=",),
    "lessThan": ("<",),
    "lessOrEqual": ("<=",),
    "equalTo": ("<=", ">="),
    "notEqualTo": ("<", ">"),
}


def constraints_of(parameters: Parameters) -> list[Constraint]:
    """Returns constraints between varying numbers; raises `ConfigError` if a constant breaks its."""
    return [constraint for declared in parameters.declared.values() for constraint in _of(declared, parameters)]


def _of(declared: Declared, parameters: Parameters) -> Iterator[Constraint]:
    groups = [group.all("ValueConstraint") for group in declared.at.all("ConstraintGroup")]
    if not groups or not all(groups):
        return
    meaning = parameters.meaning(declared.name)
    if meaning is None or meaning.expression is None:
        if declared.name not in parameters.varied and not allowed(
            declared, parameters, meaning.text if meaning else ""
        ):
            raise declared.at.refusal(f"the value {declared.value[:80]!r}", "one that its constraints allow")
        return
    parts = [[_number(member, coded(meaning.expression).text) for member in group] for group in groups]
    joined = _any([_all(group) for group in parts])
    if not _names(joined) <= parameters.constants.keys():
        yield joined
        return
    if not holds(joined, parameters.constants):
        got = f"the value {declared.value[:80]!r}, which breaks the constraint {_written(joined)[:200]}"
        raise declared.at.refusal(got, "one that its constraints allow", "change the value")


def allowed(declared: Declared, parameters: Parameters, text: str) -> bool:
    """Whether the constraints of a parameter with words allow a text."""
    groups = [group.all("ValueConstraint") for group in declared.at.all("ConstraintGroup")]
    return not groups or any(all(_text_holds(member, text, parameters) for member in group) for group in groups)


def _text_holds(member: At, text: str, parameters: Parameters) -> bool:
    wanted, signs = member.meaning("value"), member.one_of("rule", _SIGNS)
    if signs in (_SIGNS["equalTo"], _SIGNS["notEqualTo"]):
        return (text == wanted.text) == (signs == _SIGNS["equalTo"])
    own = literal(text).expression
    if own is None or wanted.expression is None:
        raise member.refusal(f"{text[:80]!r} and {wanted.text[:80]!r}", "numbers, or the rule equalTo or notEqualTo")
    names = comparison(f"{coded(own).text} {signs[0]} {coded(wanted.expression).text}")
    return not names.names() <= parameters.constants.keys() or bool(names.value(parameters.constants))


def _number(member: At, name: str) -> Constraint:
    signs, value = member.one_of("rule", _SIGNS), coded(member.number("value")).text
    parts = [f"{name} {sign} {value}" for sign in signs]
    return _any(parts) if signs == _SIGNS["notEqualTo"] else _all(parts)


def _all(parts: Sequence[Constraint]) -> Constraint:
    return parts[0] if len(parts) == 1 else AllOf(all=tuple(parts))


def _any(parts: Sequence[Constraint]) -> Constraint:
    return parts[0] if len(parts) == 1 else AnyOf(any=tuple(parts))


def _parts(constraint: AllOf | AnyOf) -> tuple[Constraint, ...]:
    return constraint.all if isinstance(constraint, AllOf) else constraint.any


def _names(constraint: Constraint) -> set[str]:
    if isinstance(constraint, str):
        return comparison(constraint).names()
    return set().union(*map(_names, _parts(constraint)))


def holds(constraint: Constraint, numbers: Mapping[str, float]) -> bool:
    """Whether a constraint holds; a value that does not exist breaks it."""
    if isinstance(constraint, str):
        try:
            return bool(comparison(constraint).value(numbers))
        except ConfigError:
            return False
    results = [holds(part, numbers) for part in _parts(constraint)]
    return all(results) if isinstance(constraint, AllOf) else any(results)


def _written(constraint: Constraint) -> str:
    if isinstance(constraint, str):
        return constraint
    return (" and " if isinstance(constraint, AllOf) else " or ").join(map(_written, _parts(constraint)))
