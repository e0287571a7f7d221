import numpy as np
import pytest

from risk_sac.config import CampaignSpec, RunMethod, RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.lab.benchmark import table
from risk_sac.lab.benchmark.runs import ANSWER, Detection, answer_of, first_detection
from risk_sac.lab.benchmark.statistics import friedman, log_rank, summaries, survival
from risk_sac.lab.figures.defects import tier_of
from risk_sac.records import DefectPower
from risk_sac.report.statistics import NOT_MEASURED, PlayedCounts, method_power, power_of, runs_of

BUDGET = 1000


def runs(method: RunMethod, defect: str, *detected: int | None) -> list[Detection]:
    return [
        Detection(
            defects=(defect,),
            family="low",
            method=method,
            seed=seed,
            budget_steps=BUDGET,
            steps=steps or BUDGET,
            episodes=10,
            reached=None,
            triggered=steps,
            detected=steps,
            refuted=0,
            kind="" if steps is None else "leader",
            episode=None,
        )
        for seed, steps in enumerate(detected)
    ]


FOUND = [
    *runs("archive", "latency", 100, 200, 300),
    *runs("archive", "speeds", 400, None, None),
    *runs("random", "latency", 500, None, 700),
    *runs("random", "speeds", None, None, None),
]


def test_a_method_is_summed_up_over_defects_and_seeds():
    archive, random = summaries(FOUND)  # the quickest first
    assert (archive.method, archive.runs, archive.detected) == ("archive", 6, 4)
    assert (archive.mean_steps, archive.median_steps) == (250.0, 250.0)
    assert archive.restricted_mean == (100 + 200 + 300 + 400 + 1000 + 1000) / 6
    assert archive.low < archive.restricted_mean < archive.high
    assert (archive.always, archive.once, archive.never) == (1, 2, 0)
    assert (random.always, random.once, random.never) == (0, 1, 1)
    # of 9 pairs archive is quicker in 9 and in 3; in the 6 others neither detects
    assert archive.a12 == pytest.approx((9 / 9 + (3 + 6 / 2) / 9) / 2)
    assert (random.a12, random.p) == (None, None)


def test_the_test_set_is_told_by_tiers(monkeypatch):
    told = {"latency": {"tier": "hard", "test_set": True}, "short-sight": {"tier": "hard", "test_set": False}}
    told["weak-brakes"] = {"tier": "easy", "test_set": True}
    monkeypatch.setattr(table, "DEFECTS", {name: DEFECTS[name].model_copy(update=row) for name, row in told.items()})
    parts = table.sections([run for name in told for run in runs("archive", name, 100)])
    assert {name: [run.defects[0] for run in part] for name, part in parts.items()} == {
        "test-set": ["latency", "weak-brakes"],
        "easy-test-set": ["weak-brakes"],
        "hard-test-set": ["latency"],
        "all": ["latency", "short-sight", "weak-brakes"],
    }


def test_tiers_go_by_the_share_of_runs_of_random_search_that_detect():
    assert [tier_of(detected, 10) for detected in (0, 2, 3, 7, 8, 10)] == ["hard"] * 2 + ["medium"] * 2 + ["easy"] * 2


def test_survival_falls_at_detections_and_not_at_the_budget():
    steps, left = survival(runs("archive", "latency", 100, 300, 300, None))
    assert dict(zip(steps.tolist(), left.tolist(), strict=True)) == pytest.approx({100: 0.75, 300: 0.25, 1000: 0.25})
    _, left = survival(runs("archive", "latency", None, None))
    assert left.tolist() == [1.0]


def test_the_log_rank_test_tells_quick_from_slow():
    quick, slow = runs("archive", "latency", *range(10, 20)), runs("random", "latency", *range(500, 510))
    assert log_rank(quick, slow) < 0.001
    assert log_rank(quick, quick) == pytest.approx(1.0)
    assert log_rank(runs("archive", "x", None), runs("random", "x", None)) == 1.0


def test_an_early_detection_counts_for_a_larger_budget_once_it_is_called_with_it(tmp_path):
    (early,) = runs("archive", "latency", 400)
    spec = RunSpec(family="low", method="archive", seed=0, ego=read_ego("idm-aeb+latency"))
    (tmp_path / ANSWER).write_text(early.model_dump_json())
    assert answer_of(tmp_path, BUDGET) == early
    assert answer_of(tmp_path, 2 * BUDGET) is None
    assert first_detection(spec, tmp_path, 2 * BUDGET) == early.within(2 * BUDGET)  # plays nothing
    assert answer_of(tmp_path, 2 * BUDGET) == early.within(2 * BUDGET)
    assert answer_of(tmp_path, BUDGET) == early


def test_ranks_that_never_differ_are_no_coincidence():
    means = np.array([[1.0, 2.0, 3.0]] * 9)
    p = friedman(means)
    assert p is not None
    assert p < 0.001
    assert friedman(means[:, :2]) is None
    assert friedman(np.ones((9, 3))) == 1.0


TEXT = """defects,family,method,seed,budget_steps,steps,episodes,detected,kind
latency,low,archive,0,20000,300,3,300,"a, b"
latency,low,archive,1,20000,20000,200,,
speeds,mixed,archive,0,20000,9000,60,9000,a
no-memory,dense,archive,0,20000,100,1,100,a
latency,low,random,0,5000,5000,50,,
"""
RUNS = runs_of(TEXT)


def test_the_power_of_a_budget_is_what_was_detected_within_it():
    found = method_power("archive", {"low": (9000, 1), "mixed": (9000, 1)}, RUNS)
    assert found.defects == (
        DefectPower(defect="latency", family="low", detected=1, runs=2),
        DefectPower(defect="speeds", family="mixed", detected=1, runs=1),
    )
    assert found.sentences == (
        "Of 2 known defects that it was measured with in low, mixed, this budget detects 1.5 on average; "
        "never found: none.",
        "Seeds that were measured: 1 to 2 of each defect.",
    )
    found = method_power("archive", {"low": (9000, 1), "mixed": (8999, 1)}, RUNS)
    assert (found.expected, found.in_most_seeds, found.never) == (0.5, (), ("speeds",))


def test_the_power_of_a_campaign_goes_by_its_own_episodes():
    spec = CampaignSpec(families=("low",), methods=("archive",), seeds=(0, 1))
    played = [PlayedCounts("low", "archive", 5, 500, ended=True), PlayedCounts("low", "archive", 5, 700, ended=True)]
    (archive,) = power_of(spec, played, RUNS).methods
    (budget,) = archive.budgets
    assert (budget.family, budget.runs, budget.episodes, budget.steps) == ("low", 2, 5, 600)


def test_power_without_a_benchmark_says_that_nothing_was_measured():
    found = power_of(CampaignSpec(families=("low",)), [], [])
    assert (found.note, found.methods, found.lines) == (NOT_MEASURED, (), [])
