"""Online monitoring of STL requirements by rtamt's operators.

rtamt supplies every operator with its state. Its own walk over the tree is replaced, because it keys an operator's
state by its text. So a sub-formula that occurs twice is updated twice per step and sees half its window. It also visits
the operands of `+` and `not` twice, and nodes by name, which takes several times as long.

Source: RISK-SAC, Sec. III-C; Nickovic, Yamaguchi, "RTAMT: online robustness monitors from STL", ATVA 2020.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from rtamt.semantics.stl.discrete_time.online import ast_visitor as rtamt

from risk_sac.config import Requirement
from risk_sac.errors import FormulaError, NotFinite
from risk_sac.risk.formula import COMPARISONS, Node, parse, signals_of
from risk_sac.world.types import Floats

ROBUSTNESS_CLIP = 3.0  # in scales; a margin beyond it is as good as any, and rtamt's warm-up is infinite

Signals = Mapping[str, float]
_OPERATORS = {
    "+": rtamt.AdditionOperation,
    "-": rtamt.SubtractionOperation,
    "*": rtamt.MultiplicationOperation,
    "/": rtamt.DivisionOperation,
    "abs": rtamt.AbsOperation,
    "not": rtamt.NotOperation,
    "and": rtamt.AndOperation,
    "or": rtamt.OrOperation,
    "implies": rtamt.ImpliesOperation,
    "prev": rtamt.PreviousOperation,
    "historically": rtamt.HistoricallyOperation,
    "once": rtamt.OnceOperation,
    "since": rtamt.SinceOperation,
}
_TIMED_OPERATORS = {
    "historically": rtamt.HistoricallyTimedOperation,
    "once": rtamt.OnceTimedOperation,
    "since": rtamt.SinceTimedOperation,
}


class Monitor:
    """Robustness of several requirements, one update per simulation step.

    Build it once per run, since parsing takes milliseconds, and `reset` it before each episode.
    """

    def __init__(self, requirements: Sequence[Requirement], step_s: float, horizon_steps: int) -> None:
        """Parses the requirements.

        Args:
          requirements: `M` of them.
          step_s: time between two updates, s; window bounds are multiples of it.
          horizon_steps: updates of one episode; no window may be longer.

        Raises:
          FormulaError: its `field` is `requirements[i].formula`; it has the position and the reason.
        """
        self.names = tuple(requirement.name for requirement in requirements)
        self.shapes = np.array([requirement.shapes for requirement in requirements])  # M; which are part of φ
        self._operators: list[Any] = []  # of rtamt, to be reset
        trees = [parsed(index, requirement, step_s, horizon_steps) for index, requirement in enumerate(requirements)]
        self.signals = sorted(set[str]().union(*map(signals_of, trees)))
        self._outputs = [
            (self._compile(tree), 1.0 / each.scale) for tree, each in zip(trees, requirements, strict=True)
        ]

    def reset(self) -> None:
        """Forgets the past, as before the first update."""
        for operator in self._operators:
            operator.reset()

    def update(self, signals: Signals) -> Floats:
        """Computes the robustness after one more step.

        Args:
          signals: value of each published signal; those that no requirement uses are not read.

        Returns:
          `M`, in scales, clipped to ±ROBUSTNESS_CLIP; below 0 means violated. While a window that
          starts in the past is still empty, `historically` holds and `once` and `since` do not.
        """
        # One check for all: the signals are far too small to overflow together.
        if not math.isfinite(sum([signals[name] for name in self.signals])):
            raise NotFinite(f"the signals are {dict(signals)}; wanted finite numbers")
        robustness = [evaluate(signals) * per_scale for evaluate, per_scale in self._outputs]
        return np.array([min(max(value, -ROBUSTNESS_CLIP), ROBUSTNESS_CLIP) for value in robustness])

    def _compile(self, node: Node) -> Callable[[Signals], float]:
        """Builds a function that updates a sub-formula, with state per operator."""
        if node.op == "signal":
            return itemgetter(node.text)
        if node.op == "number":
            number = float(node.text)
            return lambda signals: number
        left, *others = map(self._compile, node.children)
        if node.op in COMPARISONS:  # rtamt's own compares enums in every step, which doubles the time of an update
            larger, smaller = (left, others[0]) if node.op in (">", ">=") else (others[0], left)
            return lambda signals: larger(signals) - smaller(signals)
        operator = _TIMED_OPERATORS[node.op](*node.window) if node.window else _OPERATORS[node.op]()
        self._operators.append(operator)
        update = operator.update
        if not others:
            return lambda signals: update(left(signals))
        [right] = others
        return lambda signals: update(left(signals), right(signals))


def parsed(index: int, requirement: Requirement, step_s: float, horizon_steps: int) -> Node:
    """The syntax tree of the requirement at an index.

    Raises:
      FormulaError: it cannot be monitored online; the `field` is `requirements[index].formula`.
    """
    try:
        return parse(requirement.formula, step_s, horizon_steps)
    except FormulaError as error:
        error.field = f"requirements[{index}].formula"
        raise
