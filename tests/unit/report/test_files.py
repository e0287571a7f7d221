import csv
import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.metrics import results_digest, wilson_interval
from risk_sac.report import compare, figure_names, read_run, table_csv, table_json, table_markdown, write_report
from risk_sac.report.figures import window_ecr, window_pcr
from risk_sac.run_folder.results import EPISODES, RecordedFailure, Results, read_results, write_results


@pytest.fixture
def comparison(spec, runs):
    return compare(spec, runs, "risk-sac evaluate --out d", spec_file="d/spec.yaml")


def line(page, start):
    (found,) = [each for each in page.splitlines() if each.startswith(start)]
    return found


def test_page_has_command_digest_tables_and_the_paper(comparison, spec):
    page = table_markdown(comparison)
    assert "```\nrisk-sac evaluate --out d\n```" in page
    assert spec.digest in page
    _, _, first, second, *_ = section(page, "## low, search")
    assert first.startswith("| risk-sac | 2 | 0.500 [0.215, 0.785] | 0.375 [0.137, 0.694] |")
    preventable, kinds = "5.833 [5.000, 6.667]", "1.000 [1.000, 1.000]"
    assert f"| 0.167 (1 of 2 seeds) | {preventable} | {kinds} | 117 | 40.0 | 0.0 % | 0.0 % | 12.5 % |" in first
    assert second.startswith("| sac | 2 | 0.125")
    assert "| – | 2.500 [0.000, 5.000] | 0.500 [0.000, 1.000] | 400 |" in second
    assert line(page, "| low | search | 0.50").split(" | ")[3] == "0.97"
    assert "| low | search | 8 | 12.5 % |" in page
    assert "risk-sac run --spec d/spec.yaml --family low --method risk-sac --seed 0 --out repeated" in page
    assert comparison.runs[0].digest in page
    assert "## Missing" not in page


def section(page, title):
    """The rows of the table below a title."""
    return [each for each in page[page.index(title) :].split("\n\n")[1].splitlines() if each.startswith("| ")]


def test_page_json_and_csv_say_which_driver_prevents_how_bad_it_is_and_whose_fault(spec, finished):
    only = spec.model_copy(update={"methods": ("sac",), "seeds": (0,)})
    run = finished(only.runs()[0], "fF..", ".")
    compared = compare(only, [run], "risk-sac evaluate")
    page = table_markdown(compared)
    low, high = wilson_interval(1, 4)
    share = f"0.250 [{low:.3f}, {high:.3f}]"
    assert section(page, "### PCR by reference driver: low, search") == [
        "| method | r157 | bound |",
        "| --- | ---: | ---: |",
        f"| sac | {share} | 0.500 [0.150, 0.850] |",
    ]
    assert section(page, "### Severity and fault: low, search")[2] == (
        "| sac | 1 (50 %) | 1 (50 %) | 0 (0 %) | 0 (0 %) | 1 (100 %) | 0 (0 %) |"
    )
    cell, _ = json.loads(table_json(compared))["cells"]
    assert cell["pcr_by_driver"]["r157"] == {"prevented": 1, "pcr": 0.25, "pcr_low": low, "pcr_high": high}
    assert (cell["by_severity"], cell["by_fault"]) == ({"moderate": 1, "severe": 1}, {"shared": 1})
    row, _ = csv.DictReader(io.StringIO(table_csv(compared)))
    assert (row["r157.prevented"], row["severity.severe"], row["fault.ego"]) == ("1", "1", "0")


def test_page_says_what_is_missing_and_why(spec, runs):
    comparison = compare(spec, runs[1:], "", reasons={runs[0].spec.digest: "killed | by\nSIGSEGV"})
    page = table_markdown(comparison)
    assert "## Missing: 1 runs" in page
    assert "| low | sac | 0 | killed \\| by SIGSEGV |" in page
    assert "| sac | 1 of 2 |" in page


def test_json_is_strict_and_complete(comparison, spec):
    stored = json.loads(table_json(comparison))
    assert stored["format_version"] == 1
    assert stored["spec_digest"] == spec.digest
    assert stored["complete"] is True
    assert stored["versions"] == {"numpy": "2.4"}
    assert set(stored["platform"]) == {"machine", "cpu", "python"}
    assert len(stored["runs"]) == 6
    row = stored["runs"][0]
    assert (row["family"], row["method"], row["seed"], row["cpu_s"]) == ("low", "risk-sac", 0, 60.0)
    assert row["digest"] == comparison.runs[0].digest
    assert row["spec_digest"] == comparison.runs[0].spec.digest
    assert row["metrics"]["search"]["failures"] == 3
    assert row["metrics"]["evaluation"]["failures"] == 1
    assert row["metrics"]["search"]["signatures"] == {"cut-in, straight": 2, "leader, straight": 1}
    assert stored["cells"][0]["contacts_by_second"][:4] == [0, 0, 0, 4]
    assert stored["cells"][0]["signatures"] == {"cut-in, straight": 3, "leader, straight": 1}


def test_sliding_pcr_by_hand(comparison):
    run = comparison.of_cell("low", "risk-sac")[0]  # two that a careful driver prevents, one that only the bound does
    np.testing.assert_allclose(window_ecr(run), [1, 1, 1, 3 / 4])
    np.testing.assert_allclose(window_pcr(run), [1, 1, 2 / 3, 2 / 4])


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
