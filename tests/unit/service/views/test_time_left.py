"""How long a campaign takes until it ends, told by what it has done."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import CampaignSpec
from risk_sac.records import State
from service.views.time_left import eta_s, retry_after_s
from tests.begun import BEGUN

SPEC = CampaignSpec(families=("low",), methods=("random",))
RUN = BEGUN.model_copy(update={"method": "random"})


def changed(run, **fields):
    return run.model_copy(update=fields)


def after_start(done, worked_s, start_s=5.0):
    """A run of `random` that has played so many episodes after its first one."""
    pace_s = worked_s / done if done else None
    return changed(RUN, episodes_done=done + 1, pace_s=pace_s, busy_s=start_s + worked_s)


@pytest.mark.parametrize(
    ("done", "workers", "wanted"),
    [
        ([(19, 38.0)], 2, 160.0),  # 80 left at 2 s
        ([(19, 38.0), (59, 59.0)], 2, 160.0),  # the slower of two at once
        ([(19, 38.0), (59, 59.0)], 1, 200.0),  # one after the other
    ],
)
def test_eta_is_work_left_at_each_runs_own_pace(done, workers, wanted):
    assert eta_s([after_start(*each) for each in done], SPEC, workers) == pytest.approx(wanted)


@given(st.lists(st.tuples(st.integers(1, 99), st.floats(0.1, 100)), min_size=1, max_size=6), st.integers(1, 8))
def test_more_workers_never_take_longer(done, workers):
    runs = [after_start(*each) for each in done]
    assert 0 <= eta_s(runs, SPEC, workers + 1) <= eta_s(runs, SPEC, workers)


# Recorded runs in `low` or dense: episodes; processor time until the first, a tenth of them and the end, s.
RECORDED = {
    "risk-sac in dense": (120, 4.3, 5.26, 18.3),
    "random": (100, 30.9, 31.5, 37.0),  # compiles first
    "archive": (100, 3.1, 3.49, 6.9),
    "bo-only": (100, 3.0, 3.61, 10.8),
    "no-adversary": (100, 2.9, 3.34, 6.9),
    "risk-sac": (200, 4.5, 5.16, 67.4),
    "risk-sac-diverse": (250, 4.4, 5.28, 14.3),
    "sac-lag": (100, 4.4, 4.78, 16.4),
    "ddpg-lag": (170, 4.4, 5.03, 49.4),
}


@pytest.mark.parametrize("name", RECORDED)
def test_after_a_tenth_of_the_episodes_the_estimate_is_right_within_a_factor_of_two(name):
    total, first_s, tenth_s, end_s = RECORDED[name]
    method, _, family = name.partition(" in ")
    spec = CampaignSpec.model_validate({"families": ["low"], "methods": [method], "budget": {"episodes": total}})
    run = changed(RUN, method=method, episodes_total=total, episodes_done=total // 10)
    pace_s = (tenth_s - first_s) / (total // 10 - 1)
    run = changed(run, pace_s=pace_s, busy_s=tenth_s, family=family or "low")
    assert 0.5 <= eta_s([run], spec, workers=1) / (end_s - tenth_s) <= 2


@pytest.mark.parametrize(
    ("done", "busy_s", "wanted"),
    [(0, 0.0, 1), (49, 1.0, 1), (49, 98.0, 5), (49, 100.0, 6), (49, 9_800.0, 30)],  # a little longer than it took
)
def test_a_look_pays_after_a_twentieth_of_the_time_left(ledger, done, busy_s, wanted):
    campaign = ledger.create(SPEC)
    runs = (after_start(done, busy_s),)
    assert retry_after_s(changed(campaign, state=State.RUNNING, runs=runs), workers=1) == wanted
