"""Comparison of methods at equal budgets, against counts by hand."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.metrics import results_digest, wilson_interval
from risk_sac.report import compare, figure_bytes, figure_names, read_run, write_report
from risk_sac.report.comparison import declared
from risk_sac.report.figures import CURVES, window_ecr, window_pcr
from risk_sac.report.runs import Limit, cpu_s, episodes, found_within
from risk_sac.report.statistics import holm
from risk_sac.run_folder.results import EPISODES, RecordedFailure, RunResults, read_results, write_results
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
    assert (missing.method, missing.seed, missing.reason) == ("sac", 1, "crashed")
    assert cell(comparison, "sac").seeds == (0,)
    tests = [test for test in comparison.tests if test.method == "sac" and test.metric == "ecr"]
    assert [(test.pairs, test.p) for test in tests] == [(1, None), (1, None)]


def test_report_loads_without_torch_and_libsumo():
    heavy = {"torch", "libsumo", "botorch", "numba", "rtamt"}
    code = f"import sys, risk_sac.report; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.fixture
def run(spec, finished):
    """F: no driver prevents the failure; f: the careful driver; r: refused."""
    return replace(finished(spec.runs()[0], ".FrfFf", "f"), episode_cpu_s=(2.0, 4.0, 4.5, 9.0, 10.0, 12.0, 20.0))


def test_each_kind_counts_once_from_the_episode_on_that_found_it(run):
    counts = [(found.preventable, found.distinct) for found in run.found]
    assert counts == [(0, 0), (0, 1), (0, 1), (1, 2), (1, 2), (1, 2)]


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        (Limit("", cpu_s, 1.0), (0, 0)),  # the first episode ended later
        (Limit("", cpu_s, 8.9), (0, 1)),
        (Limit("", cpu_s, 9.0), (1, 2)),
        (Limit("", episodes, 2), (0, 1)),
        (Limit("", episodes, 6), (1, 2)),
    ],
)
def test_what_ended_within_the_limit_counts(run, limit, expected):
    found = found_within(run, limit)
    assert (found.preventable, found.distinct) == expected


def test_our_own_search_is_tested_against_the_others_on_what_a_user_pays_for(spec, finished):
    budget = {"budget": spec.budget.model_copy(update={"evaluation_episodes": 0})}
    methods = {"methods": ("risk-sac", "risk-sac-diverse", "random"), "seeds": tuple(range(6))}
    wanted = spec.model_copy(update=budget | methods)
    letters = {"risk-sac": "....", "risk-sac-diverse": "f...", "random": "f..."}
    runs = [replace(finished(run, letters[run.method]), episode_cpu_s=(5.0, 10.0, 20.0, 31.0)) for run in wanted.runs()]
    against = {test.method: test for test in compare(wanted, runs, "a command").paid_tests}
    assert {test.reference for test in against.values()} == {"risk-sac-diverse"}
    assert (against["risk-sac"].difference, against["random"].difference) == (1.0, 0.0)
    assert against["risk-sac"].p == pytest.approx(2 / 2**6)
    assert against["risk-sac"].p_holm == pytest.approx(2 * 2 / 2**6)  # of two hypotheses, whatever else is tested


@pytest.fixture
def files_comparison(spec, runs):
    return compare(spec, runs, "risk-sac evaluate --out d", spec_file="d/spec.yaml")


def test_sliding_rates_are_of_contacts_and_end_where_the_metrics_do(spec, finished):
    run = finished(spec.runs()[0], "vfFkd")  # its first failure is no contact
    np.testing.assert_allclose(window_ecr(run), [0, 1 / 2, 2 / 3, 2 / 4, 2 / 5])
    np.testing.assert_allclose(window_pcr(run), [0, 1 / 2, 1 / 3, 1 / 4, 1 / 5])
    metrics = run.metrics["search"]
    assert (metrics.window_ecr, metrics.window_pcr) == (0.4, 0.2)


MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml"}


def test_report_is_written_twice_alike(spec, runs, tmp_path):
    # Without the evaluation, whose figures tests/acceptance/test_evaluate.py draws twice.
    search = {"budget": spec.budget.model_copy(update={"evaluation_episodes": 0})}
    searches = [replace(run, spec=run.spec.model_copy(update=search)) for run in runs]
    files_comparison = compare(spec.model_copy(update=search), searches, "")

    def content():
        write_report(files_comparison, tmp_path)
        return {path.relative_to(tmp_path): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    first = content()
    assert len(first) == 3 + 2 * len(figure_names(files_comparison))
    assert {file.suffix for file in first} == {".json", ".md", ".csv", *MAGIC}
    assert all(written.startswith(MAGIC.get(file.suffix, b"")) for file, written in first.items())
    assert content() == first


def test_a_run_in_which_nothing_was_ever_close_can_be_read(runs, tmp_path):
    records = [never_close(record) for record in runs[0].records]
    results = RunResults(
        spec=runs[0].spec,
        spec_digest=runs[0].spec.digest,
        finished=True,
        digest=results_digest(records),
        failures=tuple(
            RecordedFailure.of(runs[0].spec.id, record) for record in records if record.worst_violation is not None
        ),
    )
    write_results(tmp_path, results)
    (tmp_path / EPISODES).write_text("".join(record.model_dump_json() + "\n" for record in records))
    assert read_results(tmp_path).failures == results.failures
    assert read_run(tmp_path).records == tuple(records)


def never_close(record):
    least = {"min_ttc_s": math.inf, "min_robustness": math.inf}
    collision = record.collision and record.collision.model_copy(update=least | {"min_rss_margin_m": math.inf})
    return record.model_copy(update=least | {"collision": collision})


def test_runs_of_unequal_length_are_drawn_as_far_as_all_came(spec, finished):
    runs = [finished(run, "..f.f" if run.seed else "..f", ".") for run in spec.runs()]
    comparison = compare(spec, runs, "")
    (curve,) = [curve for curve in CURVES if curve.name == "ecr"]
    at, values = curve.over([runs[0], next(run for run in runs if run.spec.seed)])
    assert (at.tolist(), values.shape) == ([1.0, 2.0, 3.0], (2, 3))
    assert figure_bytes(comparison, "ecr_low", "svg").startswith(b"<?xml")
