"""What one update of the shipped requirements costs, beside rtamt's own update of the same formulas."""

import timeit

import numpy as np
import pytest
import rtamt

from risk_sac.config import DynamicElements, Environment, Interval, Odd, Scenery
from risk_sac.risk.formula import parse
from risk_sac.risk.realism import soft_cost
from risk_sac.risk.signals import SIGNALS
from risk_sac.risk.stl import Monitor, soft_min
from risk_sac.scenario.odd import requirements_from_odd

BUDGET_US = 60.0
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
