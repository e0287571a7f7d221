from risk_sac.config import CampaignSpec
from risk_sac.records import State
from service.views.progress import progress
from tests.begun import BEGUN as RUN


def changed(run, **fields):
    return run.model_copy(update=fields)


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
    replayed = changed(ended, metrics=metrics.model_copy(update={"headline": 1}), headline_candidates=2)
    waiting = changed(at_work, headline_candidates=4)
    partly = progress(changed(campaign, state=State.RUNNING, runs=(replayed, waiting)), workers=1)
    assert (partly.headline_candidates, partly.headline_waiting) == (6, 4)
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
