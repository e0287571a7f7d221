import subprocess
import sys

import pytest

from risk_sac.metrics import wilson_interval
from risk_sac.report import compare
from risk_sac.report.comparison import declared
from risk_sac.report.paired import holm
from risk_sac.scenario.families import FAMILIES

HORIZON = FAMILIES["low"].horizon_steps


@pytest.fixture
def comparison(spec, runs):
    return compare(spec, runs, "risk-sac evaluate")


def cell(comparison, method, phase="search"):
    (found,) = [each for each in comparison.cells if (each.method, each.phase) == (method, phase)]
    return found


def test_a_cell_is_the_mean_over_seeds_and_sums_over_seeds(comparison):
    found = cell(comparison, "risk-sac")
    ecr = found.estimates["ecr"]
    assert (ecr.mean, ecr.runs) == (0.5, 2)  # 3/4 and 1/4
    assert (ecr.low, ecr.high) == wilson_interval(4, 8)  # wider than the bootstrap, 0.25 to 0.75
    assert found.estimates["es"].mean == pytest.approx(4 * (1 - 50 / HORIZON) / 8)
    assert found.estimates["rho_c"].mean == pytest.approx(0.2)
    assert (found.episodes, found.failures, found.environment_steps) == (8, 4, 350)
    assert found.distinct_failures == 3  # f and F of one seed, f of the other
    assert found.steps_per_distinct_failure == pytest.approx(350 / 3)
    assert found.cpu_s_per_distinct_failure == pytest.approx(120 / 3)
    assert found.rejected_rate == 1 / 8


def test_the_funnel_and_pcr_are_those_of_all_seeds(comparison):
    found = cell(comparison, "risk-sac")
    assert (found.raw_collisions, found.failures) == (4, 4)
    assert (found.distinct_failures, found.preventable, found.distinct_preventable) == (3, 3, 2)  # F counts in neither
    pcr = found.estimates["pcr"]
    assert (pcr.mean, pcr.low, pcr.high) == (0.375, *wilson_interval(3, 8))  # 2/4 and 1/4
    assert (found.unresponsive, found.unresponsive_share) == (1, 1 / 4)
    assert cell(comparison, "no-adversary").unresponsive_share is None


def test_one_seed_has_wilsons_interval(spec, runs):
    alone = spec.model_copy(update={"seeds": (0,)})
    ecr = cell(compare(alone, runs, ""), "risk-sac").estimates["ecr"]
    assert (ecr.low, ecr.high) == wilson_interval(3, 4)
    for name in ("pcr", "pcr_last"):
        pcr = cell(compare(alone, runs, ""), "risk-sac").estimates[name]
        assert (pcr.low, pcr.high) == wilson_interval(2, 4)


def test_runs_are_tested_in_pairs_of_a_seed(comparison):
    (test,) = [each for each in comparison.tests if (each.phase, each.metric, each.method) == ("search", "ecr", "sac")]
    assert (test.reference, test.pairs) == ("risk-sac", 2)
    assert test.difference == pytest.approx((0.75 + 0.0) / 2)
    assert (test.low, test.high) == (0.0, 0.75)
    assert test.p == 1.0  # one difference is 0, and one alone says nothing
    assert test.a12 == pytest.approx((1 + 1 + 1 + 0.5) / 4)


def test_holm_corrects_over_family_and_phase(comparison):
    search = [test for test in comparison.tests if test.phase == "search"]
    assert len(search) == 2 * 6
    with_p = [test for test in search if test.p is not None]
    assert all(test.p_holm >= test.p for test in with_p)
    ours = [test for test in search if declared(test)]
    assert {(test.metric, test.method) for test in ours} == {("ecr", "sac"), ("pcr", "sac")}
    assert [test.p_holm for test in ours] == holm([test.p for test in ours])
    ofd = [test for test in search if test.metric == "ofd"]
    assert all(
        (test.pairs, test.p, test.p_holm, test.difference, test.a12) == (0, None, None, None, None) for test in ofd
    )


def test_a_missing_seed_costs_its_pair(spec, runs):
    without = [run for run in runs if (run.spec.method, run.spec.seed) != ("sac", 1)]
    comparison = compare(spec, without, "", reasons={run.spec.digest: "crashed" for run in runs})
    (missing,) = comparison.missing
    assert (missing.spec.method, missing.spec.seed, missing.reason) == ("sac", 1, "crashed")
    assert cell(comparison, "sac").seeds == (0,)
    tests = [test for test in comparison.tests if test.method == "sac" and test.metric == "ecr"]
    assert [(test.pairs, test.p) for test in tests] == [(1, None), (1, None)]


def test_report_loads_without_torch_and_libsumo():
    heavy = {"torch", "libsumo", "botorch", "numba", "rtamt"}
    code = f"import sys, risk_sac.report; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
