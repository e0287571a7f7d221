"""Formulas that want to do harm are refused, or watched for a whole episode; how long that takes, bench_stl says."""

import numpy as np
import pytest
from pydantic import ValidationError

from risk_sac.config import Requirement
from risk_sac.errors import FormulaError
from risk_sac.risk.signals import SIGNALS
from risk_sac.risk.stl import ROBUSTNESS_CLIP, Monitor
from tests.hostile_formulas import LONGEST, formulas

STEP_S, STEPS = 0.1, 200
FORMULAS = formulas()
SHARES = 8  # one test each, so that several processes can share the work


@pytest.fixture(scope="module")
def trace() -> list[dict[str, float]]:
    """Any values that the signals may have."""
    generator = np.random.default_rng(0)
    return [{name: generator.uniform(info.low, info.high) for name, info in SIGNALS.items()} for _ in range(STEPS)]


def watch(formula: str, trace: list[dict[str, float]]) -> FormulaError | ValidationError | None:
    """Watch a formula to the end; why it is refused, if it is, by an error that means a 422."""
    try:
        monitor = Monitor([Requirement(name="mine", formula=formula, scale=1.0)], STEP_S, STEPS)
    except (FormulaError, ValidationError) as error:
        return error
    for signals in trace:
        [robustness] = monitor.update(signals)
        assert abs(robustness) <= ROBUSTNESS_CLIP
    return None


@pytest.mark.parametrize("share", range(SHARES))
def test_hostile_formulas_are_refused_or_watched_to_the_end(share: int, trace: list[dict[str, float]]) -> None:
    refusals = [watch(formula, trace) for formula in FORMULAS[share::SHARES]]
    assert refusals.count(None) > 10
    wrong = [refusal for refusal in refusals if isinstance(refusal, FormulaError)]
    assert len(wrong) > 50
    assert all(refusal.field == "requirements[0].formula" for refusal in wrong)
    assert all(refusal.position is not None and 0 <= refusal.position <= LONGEST for refusal in wrong)
