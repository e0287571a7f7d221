"""Cost of judging one contact once compiled: rules, conflict, drivers, labels, names.

Processor time: it is one thread, and others use the machine too.
"""

import time
import timeit

import pytest

from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.judge import judge
from risk_sac.verdicts.validity import artefact_verdicts
from tests.unit.verdicts.staged import CLEAN, crossing_car, cut_in, leader_brakes, pedestrian_crosses

BUDGET_MS = 4.0
STAGED = {
    "cut-in": lambda: cut_in(gap=8.0, ego=12.0, other=10.0, at_s=7.0),  # 12 s
    "leader": leader_brakes,
    "pedestrian": pedestrian_crosses,
    "crossing": crossing_car,
}


def verdict(evidence: Evidence) -> None:
    conflict = find_conflict(evidence, 1)
    valid = all(artefact_verdicts(evidence, 1, conflict, CLEAN).values())
    judge(evidence, "actor_1", valid=valid, conflict=conflict)


@pytest.mark.bench
@pytest.mark.parametrize("name", STAGED)
def test_a_verdict_stays_within_its_budget(name: str) -> None:
    evidence = STAGED[name]()
    assert judge(evidence, "actor_1", valid=True).grade is not None  # warm
    took_ms = min(timeit.repeat(lambda: verdict(evidence), timer=time.process_time, number=20, repeat=10)) / 20 * 1e3
    print(f"\n{name}, {len(evidence.time_s)} frames: {took_ms:.2f} ms")
    assert took_ms < BUDGET_MS
