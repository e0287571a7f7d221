import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import CampaignSpec
from risk_sac.records import State
from service.store.stored import StoredRun
from service.views.progress import eta_s, progress, retry_after_s

RUN = StoredRun(
    number=1,
    campaign_id="c",
    id="low-sac-0",
    family="low",
    method="sac",
    seed=0,
    spec_digest="",
    state=State.RUNNING,
    reason=None,
    started_at=None,
    finished_at=None,
    episodes_total=100,
    episodes_done=0,
    rejected=0,
    raw_collisions=0,
    failures=0,
    distinct_failures=0,
    preventable=0,
    distinct_preventable=0,
    busy_s=0.0,
    attempts=1,
    metrics=None,
    evaluation=None,
    digest=None,
    versions={},
    repetitions={},
)


def changed(run, **fields):
    return run.model_copy(update=fields)


def test_there_is_no_eta_before_the_first_episode_or_without_anybody_to_work():
    assert eta_s([RUN, RUN], workers=2) is None
    assert eta_s([changed(RUN, episodes_done=20, busy_s=40.0)], workers=0) is None


@pytest.mark.parametrize(
    ("done", "workers", "wanted"),
    [
        ([(20, 40.0)], 2, 160.0),  # 80 left at 2 s
        ([(20, 40.0), (60, 60.0)], 2, 160.0),  # the slower of two at once
        ([(20, 40.0), (60, 60.0)], 1, 200.0),  # one after the other
        ([(20, 40.0), (0, 0.0)], 1, 360.0),  # no pace yet: that of the others
    ],
)
def test_eta_is_work_left_at_each_runs_own_pace(done, workers, wanted):
    runs = [changed(RUN, episodes_done=episodes, busy_s=busy) for episodes, busy in done]
    assert eta_s(runs, workers) == wanted


@given(st.lists(st.tuples(st.integers(1, 100), st.floats(0.1, 100)), min_size=1, max_size=6), st.integers(1, 8))
def test_more_workers_never_take_longer(done, workers):
    runs = [changed(RUN, episodes_done=episodes, busy_s=busy) for episodes, busy in done]
    assert 0 <= eta_s(runs, workers + 1) <= eta_s(runs, workers)


def test_progress_counts_all_runs_and_shows_those_at_work(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac", "random")))
    ended = changed(RUN, state=State.SUCCEEDED, episodes_done=100, failures=5, raw_collisions=9, metrics=metrics)
    ended = changed(ended, distinct_failures=4, preventable=3, distinct_preventable=2)
    present = metrics.model_copy(update={"dual_variable": 0.9, "window_ecr": 0.1, "window_pcr": 0.05})
    at_work = changed(RUN, episodes_done=50, failures=1, distinct_failures=1, metrics=present)
    shown = progress(changed(campaign, state=State.RUNNING, runs=(ended, at_work)), workers=1)
    assert (shown.episodes_done, shown.episodes_total) == (150, 200)
    assert (shown.failures, shown.raw_collisions) == (6, 9)
    assert (shown.distinct_failures, shown.preventable, shown.distinct_preventable) == (5, 3, 2)
    assert (shown.dual_variable, shown.window_ecr, shown.window_pcr) == (0.9, 0.1, 0.05)
    final = progress(changed(campaign, state=State.SUCCEEDED, runs=(ended, ended)), workers=1)
    assert (final.dual_variable, final.eta_s) == (0.3, 0.0)


def test_rates_are_those_of_the_methods_that_learn_where_there_are_any(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac", "random")))
    learning = changed(RUN, metrics=metrics.model_copy(update={"window_ecr": 0.4, "dual_variable": 0.5}))
    control = changed(
        RUN, method="random", metrics=metrics.model_copy(update={"window_ecr": 0.0, "dual_variable": 0.0})
    )
    for state in (State.RUNNING, State.SUCCEEDED):
        runs = (changed(learning, state=state), control)
        shown = progress(changed(campaign, state=State.RUNNING, runs=runs), workers=1)
        assert (shown.window_ecr, shown.dual_variable) == (0.4, 0.5)
    alone = progress(changed(campaign, state=State.RUNNING, runs=(control,)), workers=1)
    assert (alone.window_ecr, alone.dual_variable) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("done", "busy_s", "wanted"),
    [(0, 0.0, 1), (50, 1.0, 1), (50, 100.0, 5), (50, 101.0, 6), (50, 10_000.0, 30)],  # as long again as it took
)
def test_a_look_pays_after_a_twentieth_of_the_time_left(ledger, done, busy_s, wanted):
    campaign = ledger.create(CampaignSpec(families=("low",)))
    runs = (changed(RUN, episodes_done=done, busy_s=busy_s),)
    assert retry_after_s(changed(campaign, state=State.RUNNING, runs=runs), workers=1) == wanted


@pytest.mark.parametrize("state", [State.SUCCEEDED, State.FAILED, State.CANCELLED])
def test_no_look_pays_at_what_has_ended(ledger, state):
    campaign = ledger.create(CampaignSpec(families=("low",)))
    assert retry_after_s(changed(campaign, state=state), workers=1) is None
