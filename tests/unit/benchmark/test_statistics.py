import pytest

from risk_sac.benchmark.detection import Detection
from risk_sac.benchmark.statistics import log_rank, summaries, survival
from risk_sac.benchmark.table import curves, defects_table, detections_csv, methods_table
from risk_sac.config import RunMethod

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
            signature="" if steps is None else "leader",
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


def test_a_method_is_summed_up_over_defects_and_seeds() -> None:
    archive, random = summaries(FOUND)  # the quickest first
    assert (archive.method, archive.runs, archive.detected, archive.rate) == ("archive", 6, 4, 4 / 6)
    assert (archive.mean_steps, archive.median_steps) == (250.0, 250.0)
    assert archive.restricted_mean == (100 + 200 + 300 + 400 + 1000 + 1000) / 6
    assert archive.low < archive.restricted_mean < archive.high
    assert (archive.always, archive.once, archive.never) == (1, 2, 0)
    assert (random.always, random.once, random.never) == (0, 1, 1)
    # of 36 pairs archive is quicker in 4 x 6, and as quick in 2 x 4
    assert archive.a12 == (24 + 8 / 2) / 36
    assert (random.a12, random.p) == (None, None)


def test_survival_falls_at_detections_and_not_at_the_budget() -> None:
    steps, left = survival(runs("archive", "latency", 100, 300, 300, None))
    assert dict(zip(steps.tolist(), left.tolist(), strict=True)) == pytest.approx({100: 0.75, 300: 0.25, 1000: 0.25})
    _, left = survival(runs("archive", "latency", None, None))
    assert left.tolist() == [1.0]


def test_the_log_rank_test_tells_quick_from_slow() -> None:
    quick, slow = runs("archive", "latency", *range(10, 20)), runs("random", "latency", *range(500, 510))
    assert log_rank(quick, slow) < 0.001
    assert log_rank(quick, quick) == pytest.approx(1.0)
    assert log_rank(runs("archive", "x", None), runs("random", "x", None)) == 1.0


def test_tables_hold_every_run() -> None:
    assert methods_table(FOUND).splitlines()[2].startswith("| archive | 6 | 4 | 0.67 [0.30, 0.90] | 250 | 250 | 500 [")
    assert defects_table(FOUND).splitlines()[2:] == [
        "| latency | low | 3 of 3, 200 | 2 of 3, 600 |",
        "| speeds | low | 1 of 3, 400 | 0 of 3 |",
    ]
    assert len(detections_csv(FOUND).decode().splitlines()) == 1 + len(FOUND)
    assert [line.get_label() for line in curves(FOUND).axes[0].get_lines()] == ["archive", "random"]
