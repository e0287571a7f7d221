"""Online monitoring of STL requirements by rtamt.

rtamt parses each requirement and supplies every operator with its state. What is replaced is the walk
over the tree: rtamt visits nodes by name and type in every step, and keys an operator's state by its text, so that
a sub-formula that occurs twice is updated twice per step and sees half its window. Here each operator is
updated exactly once per step, in order, which is both right and several times faster.

Source: RISK-SAC, Sec. III-C; Nickovic, Yamaguchi, "RTAMT: online robustness monitors from STL", ATVA 2020.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from operator import sub
from typing import Any

import numpy as np
import rtamt

from risk_sac.config import Requirement
from risk_sac.errors import FormulaError, NotFinite
from risk_sac.risk.formula import Node, parse, signals_of
from risk_sac.types import Floats

ROBUSTNESS_CLIP = 3.0  # in scales; a margin beyond it is as good as any, and rtamt's warm-up is infinite

Instruction = tuple[Callable[..., float], int, int, int]  # operator, its operands' slots (-1: none), its own slot


class Monitor:
    """Robustness of several requirements, one update per simulation step.

    Build it once per run, since parsing takes milliseconds, and `reset` it before each episode.
    """

    def __init__(self, requirements: Sequence[Requirement], step_s: float, horizon_steps: int) -> None:
        """Parse the requirements.

        Args:
          requirements: `M` of them.
          step_s: time between two updates, s; window bounds are multiples of it.
          horizon_steps: updates of one episode; no window may be longer.

        Raises:
          FormulaError: naming the requirement, the position and the reason.
        """
        self.names = tuple(requirement.name for requirement in requirements)
        self.shapes = np.array([requirement.shapes for requirement in requirements])  # M; which are part of φ
        self._slots: dict[str, int] = {}  # text of a sub-formula -> where its value lies
        self._values: list[float] = []
        self._operators: list[Any] = []
        self._program: list[Instruction] = []
        self._outputs: list[tuple[int, float]] = []  # slot of each requirement's value, and what it is multiplied by
        signals: set[str] = set()
        for index, requirement in enumerate(requirements):
            tree, root, operators = _parse(index, requirement, step_s, horizon_steps)
            signals |= signals_of(tree)
            self._outputs.append((self._compile(root, operators), 1.0 / requirement.scale))
        self._inputs = [(name, self._slots[name]) for name in sorted(signals)]

    def reset(self) -> None:
        """Forget the past, as before the first update."""
        for operator in self._operators:
            operator.reset()

    def update(self, signals: Mapping[str, float]) -> Floats:
        """Robustness after one more step.

        Args:
          signals: value of each published signal; those that no requirement uses are not read.

        Returns:
          `M`, in scales, clipped to ±ROBUSTNESS_CLIP; below 0 means violated. While a window that
          starts in the past is still empty, `historically` holds and `once` and `since` do not.
        """
        values = self._values
        total = 0.0
        for name, slot in self._inputs:
            values[slot] = signals[name]
            total += values[slot]
        if not math.isfinite(total):  # one check for all: the signals are far too small to overflow together
            raise NotFinite(f"the signals are {dict(signals)}; wanted finite numbers")
        for operator, left, right, slot in self._program:
            values[slot] = operator(values[left]) if right < 0 else operator(values[left], values[right])
        robustness = [values[slot] * per_scale for slot, per_scale in self._outputs]
        return np.array([min(max(value, -ROBUSTNESS_CLIP), ROBUSTNESS_CLIP) for value in robustness])

    def _compile(self, node: Any, operators: Mapping[str, Any]) -> int:
        """Append what computes rtamt's `node` to the program; the slot of its value.

        Equal text means equal value in every step, whichever requirement it comes from.
        """
        if node.name in self._slots:
            return self._slots[node.name]
        operands = [self._compile(child, operators) for child in node.children]
        slot = self._slots[node.name] = len(self._values)
        self._values.append(getattr(node, "val", math.nan))  # a number's value; the rest is computed
        if operands:
            operator = operators[node.name]
            self._operators.append(operator)
            left, right = operands if len(operands) == 2 else (operands[0], -1)
            comparison = getattr(operator, "comparison_op", None)
            if comparison is None:
                self._program.append((operator.update, left, right, slot))
            elif comparison.name in ("LEQ", "LESS"):  # stateless; rtamt compares enums at every update
                self._program.append((sub, right, left, slot))
            else:
                self._program.append((sub, left, right, slot))
        return slot


def check_requirements(requirements: Sequence[Requirement], step_s: float, horizon_steps: int) -> None:
    """Refuse requirements that cannot be monitored online.

    Raises:
      FormulaError: its `field` is `requirements[i].formula`.
    """
    Monitor(requirements, step_s, horizon_steps)


def _parse(
    index: int, requirement: Requirement, step_s: float, horizon_steps: int
) -> tuple[Node, Any, Mapping[str, Any]]:
    """Our tree of a requirement, and rtamt's with its operators by text."""
    try:
        tree = parse(requirement.formula, step_s, horizon_steps)
        return tree, *_rtamt_tree(tree)
    except FormulaError as error:
        raise FormulaError(
            f"requirement {requirement.name!r}: {error}",
            field=f"requirements[{index}].formula",
            position=error.position,
        ) from error


def _rtamt_tree(tree: Node) -> tuple[Any, Mapping[str, Any]]:
    specification = rtamt.StlDiscreteTimeOnlineSpecification()  # one sample per "second": windows are in samples
    for name in signals_of(tree):
        specification.declare_var(name, "float")
    specification.spec = str(tree)
    try:
        specification.parse()
        [root] = specification.ast.specs
        _unduplicate(root)
        specification.online_interpreter.set_ast(specification.ast)
    except (rtamt.RTAMTException, KeyError, ValueError, RecursionError) as error:
        raise FormulaError(f"rtamt refuses {str(tree)!r}: {error}", position=tree.position) from error
    return root, specification.online_interpreter.online_operator_dict


def _unduplicate(node: Any) -> None:
    """Undo that rtamt lists the operands of `+` and `not` twice, and so visits them 2^depth times."""
    node.children = list(dict.fromkeys(node.children))
    for child in node.children:
        _unduplicate(child)
