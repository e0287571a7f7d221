from dataclasses import replace

import pytest

from risk_sac.config import CampaignSpec
from service.campaigns import State
from service.results import results


def test_totals_are_per_family_and_method_over_the_seeds(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac", "random"), seeds=(0, 1)))
    sac = [replace(metrics, ecr=0.25), replace(metrics, ecr=0.75, failures=3, dispersion=0.5)]
    runs = tuple(
        replace(run, metrics=sac[run.seed] if run.method == "sac" else None, state=State.RUNNING)
        for run in campaign.runs
    )
    found = results(replace(campaign, runs=runs))
    assert not found.complete
    assert [run.metrics is not None for run in found.runs] == [True, False, True, False]
    (total,) = found.totals
    assert (total.method, total.runs, total.episodes, total.failures) == ("sac", 2, 8, 4)
    assert (total.ecr, total.dispersion, total.steps_per_distinct_failure) == (0.5, 0.5, 400.0)
    assert total.ecr_low <= 0.5 <= total.ecr_high


def test_one_run_keeps_its_wilson_interval(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac",), seeds=(0,)))
    (total,) = results(replace(campaign, runs=(replace(campaign.runs[0], metrics=metrics),))).totals
    assert (total.ecr_low, total.ecr_high) == pytest.approx((0.0456, 0.6994), abs=1e-4)  # of 1 in 4
