"""Online monitoring of STL requirements by rtamt's operators.

rtamt supplies every operator that has a state. Its own walk over the tree is replaced, because it keys that state by
the operator's text. So a sub-formula that occurs twice is updated twice per step and sees half its window. It also
visits the operands of `+` and `not` twice, and nodes by name, which takes several times as long.

Source: RISK-SAC, Sec. III-C; Nickovic, Yamaguchi, "RTAMT: online robustness monitors from STL", ATVA 2020.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
from rtamt.semantics.stl.discrete_time.online import ast_visitor as rtamt

from risk_sac.config import Requirement
from risk_sac.errors import FormulaError, NotFinite
from risk_sac.risk.formula import Node, parse, signals_of
from risk_sac.world.types import Floats

ROBUSTNESS_CLIP = 3.0  # in scales; a margin beyond it is as good as any, and rtamt's warm-up is infinite

Signals = Mapping[str, float]
_STATELESS = {  # in Python
    **{operator: f"({{}} {operator} {{}})" for operator in "+-*/"},
    **dict.fromkeys((">", ">="), "({0} - {1})"),
    **dict.fromkeys(("<", "<="), "({1} - {0})"),
    "abs": "abs({})",
    "not": "(-{})",
    "and": "min({}, {})",
    "or": "max({}, {})",
    "implies": "max(-{}, {})",
}
_OPERATORS = {
    "prev": rtamt.PreviousOperation,
    "historically": rtamt.HistoricallyOperation,
    "once": rtamt.OnceOperation,
    "since": rtamt.SinceOperation,
}


class _HistoricallyTimed(rtamt.HistoricallyTimedOperation):  # type: ignore[misc]
    """rtamt's operator, whose update compares in C."""

    def update(self, sample: float) -> float:
        """The least of the window's samples, the newest included."""
        self.buffer.append(sample)
        least: float = min(islice(self.buffer, self.end - self.begin + 1))
        return least


_TIMED_OPERATORS = {
    "historically": _HistoricallyTimed,
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
        self._known: dict[str, Any] = {"abs": abs, "min": min, "max": max}  # to the source of the formulas
        trees = [parsed(index, requirement, step_s, horizon_steps) for index, requirement in enumerate(requirements)]
        self.signals = sorted(set[str]().union(*map(signals_of, trees)))
        outputs = [
            f"{self._source(tree)} * {1.0 / each.scale!r}" for tree, each in zip(trees, requirements, strict=True)
        ]
        self._evaluate: Callable[[Signals], list[float]] = eval(f"lambda signals: [{', '.join(outputs)}]", self._known)

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
        most = ROBUSTNESS_CLIP
        return np.array(
            [value if -most <= value <= most else math.copysign(most, value) for value in self._evaluate(signals)]
        )

    def _source(self, node: Node) -> str:
        """Python source of a sub-formula; called, it updates the operators in it, each with a state of its own."""
        if node.op == "signal":
            return f"signals[{node.text!r}]"
        if node.op == "number":
            return repr(float(node.text))
        operands = [*map(self._source, node.children)]
        if node.op in _STATELESS:
            return _STATELESS[node.op].format(*operands)
        operator = _TIMED_OPERATORS[node.op](*node.window) if node.window else _OPERATORS[node.op]()
        update = f"update_{len(self._operators)}"
        self._known[update] = operator.update
        self._operators.append(operator)
        return f"{update}({', '.join(operands)})"


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
