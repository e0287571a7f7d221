import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.metrics import results_digest
from risk_sac.report import compare, figure_names, read_run, write_report
from risk_sac.report.figures import window_ecr, window_pcr
from risk_sac.run_folder.results import EPISODES, RecordedFailure, Results, read_results, write_results


@pytest.fixture
def comparison(spec, runs):
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
    comparison = compare(spec.model_copy(update=search), searches, "")

    def content():
        write_report(comparison, tmp_path)
        return {path.relative_to(tmp_path): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    first = content()
    assert len(first) == 3 + 2 * len(figure_names(comparison))
    assert {file.suffix for file in first} == {".json", ".md", ".csv", *MAGIC}
    assert all(written.startswith(MAGIC.get(file.suffix, b"")) for file, written in first.items())
    assert content() == first


def test_a_run_in_which_nothing_was_ever_close_can_be_read(runs, tmp_path):
    records = [never_close(record) for record in runs[0].records]
    results = Results(
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
