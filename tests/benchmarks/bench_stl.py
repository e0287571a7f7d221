"""Cost of a monitor update, and of the worst accepted formula's episode."""

import time
import timeit

import numpy as np
import pytest
from pydantic import ValidationError

from risk_sac.config import DynamicElements, Environment, Interval, Odd, Requirement, Scenery
from risk_sac.errors import FormulaError
from risk_sac.risk.requirements import SIGNALS, requirements_from_odd
from risk_sac.risk.stl import Monitor
from tests.hostile_formulas import formulas

BUDGET_US = 40.0
HOSTILE_S, HOSTILE_STEPS = 0.2, 200  # processor time for an episode of the worst formula that is accepted
ODD = Odd(
    scenery=Scenery(signal_types=("fixed_time",)),
    environment=Environment(friction=Interval(low=0.6, high=1.0)),
    dynamic=DynamicElements(actor_kinds=("pedestrian", "vehicle")),
)


def microseconds(call: object, number: int = 5000) -> float:
    return min(timeit.repeat(call, number=number, repeat=5, timer=time.process_time)) / number * 1e6  # type: ignore[arg-type]


@pytest.mark.bench
def test_monitor_update_stays_within_its_budget() -> None:
    requirements = requirements_from_odd(ODD, 0.5)
    monitor = Monitor(requirements, 0.1, 150)
    signals = {name: info.low for name, info in SIGNALS.items()}
    took = microseconds(lambda: monitor.update(signals))
    print(f"\nSTL update of {len(requirements)} requirements: {took:.1f} µs")
    print(f"reset {microseconds(monitor.reset):.1f} µs")
    assert took < BUDGET_US


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
