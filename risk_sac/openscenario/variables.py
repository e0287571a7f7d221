"""Variables of a scenario: declarations, and what sets or changes them."""

from typing import Any

from risk_sac.config.story import VariableCondition
from risk_sac.config.story_actions import VariableAction
from risk_sac.config.values import Expression
from risk_sac.errors import ConfigError
from risk_sac.openscenario.parameters import TEXTS, Parameters
from risk_sac.openscenario.scope import At

RULES = {
    "greaterThan": "greater",
    "greaterOrEqual": "greater_or_equal",
    "lessThan": "less",
    "lessOrEqual": "less_or_equal",
    "equalTo": "equal",
    "notEqualTo": "not_equal",
}


class Variables:
    """Variables, and parameters that actions set, which are variables too."""

    def __init__(self, declarations: list[At], parameters: Parameters) -> None:
        """Reads the elements `VariableDeclaration`; raises `ConfigError` if one has no value or is there twice."""
        self.numbers: dict[str, Expression] = {}
        self.words: dict[str, str] = {}
        self._parameters = parameters
        for at in declarations:
            name = at.constant("name")
            if name in self.numbers or name in self.words:
                raise at.refusal(f"the variable {name[:80]!r} once more", "each name once")
            meaning = at.meaning("value")
            if at.constant("variableType") in TEXTS:
                self.words[name] = meaning.text[:200] or "none"
            else:
                self.numbers[name] = at.number("value")

    def action(self, at: At) -> VariableAction:
        """Reads a `VariableAction`, or a `ParameterAction`, which makes a variable of the parameter."""
        name = self._name(at, "variableRef" if at.tag == "VariableAction" else "parameterRef")
        setting, change = at.maybe("SetAction"), at.maybe("ModifyAction")
        if setting is not None:
            return at.build(VariableAction, kind="variable", variable=name, **self._value(setting, name))
        if change is None:
            raise at.refusal("neither SetAction nor ModifyAction", "one of them")
        step = change.one("Rule").one("AddValue", "MultiplyByValue")
        how = "add" if step.tag == "AddValue" else "multiply"
        return at.build(VariableAction, kind="variable", variable=name, value=step.number("value"), how=how)

    def _name(self, at: At, attribute: str) -> str:
        name = at.constant(attribute)
        if attribute == "parameterRef":
            self.add(name)
        if name not in self.numbers and name not in self.words:
            raise at.unknown(attribute, name, [*self.numbers, *self.words])
        return name

    def begin(self, actions: list[VariableAction]) -> None:
        """Gives variables the values that are set at time 0; raises `ConfigError` for other changes."""
        for action in actions:
            if action.how != "set":
                raise ConfigError("Init", f"a change of the variable {action.variable!r}", "a SetAction")
            if action.word is not None:
                self.words[action.variable] = action.word
            else:
                self.numbers[action.variable] = action.value

    def add(self, parameter: str) -> None:
        """Makes a variable of a parameter."""
        meaning = self._parameters.meaning(parameter)
        if meaning is not None and meaning.expression is not None:
            self.numbers.setdefault(parameter, meaning.expression)
        elif meaning is not None:
            self.words.setdefault(parameter, meaning.text[:200] or "none")

    def _value(self, at: At, name: str) -> dict[str, Any]:
        if name in self.words:
            return {"word": at.meaning("value").text[:200] or "none"}
        return {"value": at.number("value")}

    def condition(self, at: At, common: dict[str, Any]) -> VariableCondition:
        """Reads a `VariableCondition`, or a `ParameterCondition`.

        Args:
          at: the element.
          common: fields that all conditions have.
        """
        rule = at.one_of("rule", RULES)
        if at.tag == "VariableCondition":
            name = self._name(at, "variableRef")
            return at.build(
                VariableCondition, kind="variable", variable=name, rule=rule, **self._value(at, name), **common
            )
        name = at.constant("parameterRef")
        meaning = self._parameters.meaning(name)
        if meaning is None:
            raise at.unknown("parameterRef", name, self._parameters.declared)
        fields = {"variable": name, "rule": rule, **common}
        if name in self.numbers or name in self.words:  # an action sets it
            return at.build(VariableCondition, kind="variable", **self._value(at, name), **fields)
        if self._parameters.is_number(name):
            return at.build(VariableCondition, kind="parameter", value=at.number("value"), **fields)
        wanted = at.meaning("value").text
        if meaning.words:
            return at.build(VariableCondition, kind="parameter", word=self._parameters.word(name, wanted), **fields)
        self.words[name] = meaning.text[:200] or "none"  # a constant text, which the document has as a variable alone
        return at.build(VariableCondition, kind="variable", word=wanted[:200] or "none", **fields)
