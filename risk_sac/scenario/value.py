"""Values and words of a scene's parameters, by which expressions and choices are resolved."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from risk_sac.config.base import Chosen
from risk_sac.config.scenario import AllOf, AnyOf, Constraint
from risk_sac.config.values import Comparison, Expression, comparison, term
from risk_sac.errors import ConfigError


class Value(NamedTuple):
    """Values and words of a scene's parameters."""

    numbers: Mapping[str, float]
    words: Mapping[str, str]

    def of(self, expression: Expression, path: str = "") -> float:
        """The value of an expression; raises `ConfigError` with its path where it has none."""
        try:
            return term(expression).value(self.numbers)
        except ConfigError as error:
            raise ConfigError(path, error.got, error.expected, error.remedy) from error

    def choose(self, choice: Any) -> Any:
        """Resolves a choice by a parameter's word; anything else stays as it is."""
        return choice.of[self.words[choice.by]] if isinstance(choice, Chosen) else choice

    def word(self, name: Any) -> Any:
        """The word of a parameter if one has this name, else the name."""
        name = self.choose(name)
        return self.words.get(name, name)

    def holds(self, constraint: Constraint) -> bool:
        """Whether a constraint holds."""
        if isinstance(constraint, AllOf):
            return all(map(self.holds, constraint.all))
        if isinstance(constraint, AnyOf):
            return any(map(self.holds, constraint.any))
        return self.true(constraint)

    def true(self, text: Comparison) -> bool:
        """Whether a comparison holds."""
        return bool(comparison(text).value(self.numbers))
