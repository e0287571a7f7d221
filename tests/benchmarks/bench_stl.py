"""What one update of the shipped requirements costs, beside rtamt's own update of the same formulas."""

import time
import timeit

import numpy as np
import pytest
import rtamt
from pydantic import ValidationError

from risk_sac.config import DynamicElements, Environment, Interval, Odd, Requirement, Scenery
from risk_sac.errors import FormulaError
from risk_sac.risk.formula import parse
from risk_sac.risk.realism import soft_cost
from risk_sac.risk.signals import SIGNALS
from risk_sac.risk.soft_min import soft_min
from risk_sac.risk.stl import Monitor
from risk_sac.scenario.odd import requirements_from_odd
from tests.hostile_formulas import formulas

BUDGET_US = 60.0
HOSTILE_S, HOSTILE_STEPS = 0.2, 200  # processor time for an episode of the worst formula that is accepted
ODD = Odd(
    scenery=Scenery(signal_types=("fixed_time",)),
    environment=Environment(friction=Interval(low=0.6, high=1.0)),
    dynamic=DynamicElements(actor_kinds=("pedestrian", "vehicle")),
)


def microseconds(call: object, number: int = 5000) -> float:
    return min(timeit.repeat(call, number=number, repeat=5)) / number * 1e6  # type: ignore[arg-type]


@pytest.mark.bench
def test_monitor_update_stays_within_its_budget() -> None:
    requirements = requirements_from_odd(ODD, 0.5)
    monitor = Monitor(requirements, 0.1, 150)
    signals = {name: info.low for name, info in SIGNALS.items()}
    plain = []
    for requirement in requirements:
        specification = rtamt.StlDiscreteTimeOnlineSpecification()
        for name in SIGNALS:
            specification.declare_var(name, "float")
        specification.spec = str(parse(requirement.formula, 0.1, 150))
        specification.parse()
        plain.append(specification)
    pairs = list(signals.items())

    ours = microseconds(lambda: monitor.update(signals))
    theirs = microseconds(lambda: [specification.update(0, pairs) for specification in plain])
    robustness = monitor.update(signals)
    column = np.ones(4)
    print(f"\nSTL update of {len(requirements)} requirements: {ours:.1f} µs; rtamt's own walk {theirs:.1f} µs")
    print(f"ratio {ours / theirs:.2f}; reset {microseconds(monitor.reset):.1f} µs")
    print(f"soft-min {microseconds(lambda: soft_min(robustness, 5.0)):.1f} µs")
    print(
        f"C_soft, 4 adversaries: {microseconds(lambda: soft_cost(column, column, column, column, column, 0.1)):.1f} µs"
    )
    assert ours < BUDGET_US


@pytest.mark.bench
def test_a_hostile_formula_costs_little_over_an_episode() -> None:
    generator = np.random.default_rng(0)
    trace = [
        {name: generator.uniform(info.low, info.high) for name, info in SIGNALS.items()} for _ in range(HOSTILE_STEPS)
    ]

    def watch(formula: str) -> float:
        started = time.process_time()
        try:
            monitor = Monitor([Requirement(name="mine", formula=formula, scale=1.0)], 0.1, HOSTILE_STEPS)
        except (FormulaError, ValidationError):
            return time.process_time() - started
        for signals in trace:
            monitor.update(signals)
        return time.process_time() - started

    took = {formula: watch(formula) for formula in formulas()}
    suspects = sorted(took, key=lambda formula: took[formula])[-20:]
    worst = max(min(took[formula], *(watch(formula) for _ in range(4))) for formula in suspects)
    print(f"\n{len(took)} hostile formulas: at most {worst * 1e3:.0f} ms for {HOSTILE_STEPS} steps")
    assert worst <= HOSTILE_S
