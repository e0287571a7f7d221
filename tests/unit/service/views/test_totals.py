import pytest

from risk_sac.config import CampaignSpec
from risk_sac.metrics import wilson_interval
from risk_sac.records import RequirementCounts
from service.views.progress import progress
from service.views.totals import results


def changed(record, **fields):
    return record.model_copy(update=fields)


def test_totals_have_the_funnel_and_its_histograms(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac",), seeds=(0, 1)))
    found = {
        "raw_collisions": 5,
        "collisions": 2,
        "failures": 3,
        "distinct_failures": 2,
        "preventable": 2,
        "distinct_preventable": 1,
        "pcr": 0.5,
        "unresponsive": 1,
        "requirements": {"never_fast": RequirementCounts(counts="failure", violated=2, valid=1)},
        "signatures": {"pedestrian": 2, "cut-in, straight": 1},
        "conflicts_by_second": (1, 1, 1, 0),
        "contacts_by_second": (0, 0, 1, 2),
    }
    second = metrics.model_copy(update=found)
    first = metrics.model_copy(update={"requirements": second.requirements})
    runs = tuple(changed(run, metrics=(first, second)[run.seed]) for run in campaign.runs)
    (total,) = results(changed(campaign, runs=runs)).totals
    assert (total.raw_collisions, total.failures, total.distinct_failures) == (7, 4, 3)
    assert (total.preventable, total.distinct_preventable, total.artefacts) == (3, 2, 2)
    assert (total.pcr, total.pcr_low, total.pcr_high) == (0.375, *wilson_interval(3, 8))
    assert (total.collisions, total.unresponsive, total.unresponsive_share) == (3, 1, 1 / 3)
    pooled = total.requirements["never_fast"]
    assert (pooled.violated, pooled.valid, pooled.rate) == (4, 2, 2 / 8)
    assert total.signatures == {"cut-in, straight": 2, "pedestrian": 2}
    assert (total.conflicts_by_second, total.contacts_by_second) == ([1, 1, 2, 0], [0, 0, 1, 3])


def test_what_two_methods_found_alike_counts_once_in_the_campaign_and_once_for_each(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac", "random"), seeds=(0, 1)))
    found = {("sac", 0): ("a", "b"), ("sac", 1): ("b",), ("random", 0): ("b", "c"), ("random", 1): None}
    runs = []
    for run in campaign.runs:
        kinds = found[run.method, run.seed]
        told = {} if kinds is None else {"headline": len(kinds), "headline_kinds": kinds}
        runs.append(changed(run, metrics=metrics.model_copy(update=told)))
    searched = changed(campaign, runs=tuple(runs))
    assert {total.method: total.headline for total in results(searched).totals} == {"sac": 2, "random": 2}
    assert results(searched).headline == progress(searched, 1).headline == 3


def test_one_run_keeps_its_wilson_interval(ledger, metrics):
    campaign = ledger.create(CampaignSpec(families=("low",), methods=("sac",), seeds=(0,)))
    (total,) = results(changed(campaign, runs=(changed(campaign.runs[0], metrics=metrics),))).totals
    assert (total.ecr_low, total.ecr_high) == pytest.approx((0.0456, 0.6994), abs=1e-4)  # of 1 in 4
    assert (total.pcr_low, total.pcr_high) == (total.ecr_low, total.ecr_high)  # the same one
