"""Constraint groups of parameters: groups are joined by or, their members by and.

Source: ASAM OpenSCENARIO XML 1.3, ConstraintGroup.
"""

from collections.abc import Iterator, Mapping, Sequence

from risk_sac.config.scenario import AllOf, AnyOf, Constraint
from risk_sac.config.values import comparison
from risk_sac.errors import ConfigError
from risk_sac.openscenario.expressions import coded
from risk_sac.openscenario.parameters import Declared, Parameters
from risk_sac.openscenario.scope import At, literal

_SIGNS: Mapping[str, tuple[str, ...]] = {
    "greaterThan": (">",),
    "greaterOrEqual": (">=",),
    "lessThan": ("<",),
    "lessOrEqual": ("<=",),
    "equalTo": ("<=", ">="),
    "notEqualTo": ("<", ">"),
}


def constraints_of(parameters: Parameters) -> list[Constraint]:
    """Returns the constraints between numbers that vary.

    Raises:
      ConfigError: a constant breaks its constraints.
    """
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
