import csv
import io
import json
from dataclasses import replace

import pytest

from risk_sac.errors import ConfigError
from risk_sac.report import compare, figure_bytes, figure_names, table_csv, table_json, table_markdown, write_report


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
    section = page[page.index("## low, search") : page.index("### risk-sac against the others: low, search")]
    first, second = [each for each in section.splitlines() if each.startswith("| ")][2:4]
    assert first.startswith("| risk-sac | 2 | 0.500 [0.250, 0.750] |")
    assert "| 0.167 (1 of 2 seeds) | 3 | 117 | 40.0 | 0.0 % | 0.0 % | 12.5 % |" in first
    assert second.startswith("| sac | 2 | 0.125")
    assert "| – | 1 |" in second
    assert line(page, "| low | search | 0.50").split(" | ")[3] == "0.97"
    assert "| low | search | 8 | 12.5 % |" in page
    assert "risk-sac run --spec d/spec.yaml --family low --method risk-sac --seed 0 --out repeated" in page
    assert comparison.runs[0].digest in page
    assert "## Missing" not in page


def test_page_says_what_two_pairs_cannot_show(comparison):
    page = table_markdown(comparison)
    assert (
        "The smallest p that 2 pairs can give is 0.5; corrected over 8 tests it is at best 1. So no corrected" in page
    )
    assert "that takes 9 seeds" in page


def test_page_says_what_is_missing_and_why(spec, runs):
    comparison = compare(spec, runs[1:], "", reasons={runs[0].spec.digest: "killed | by\nSIGSEGV"})
    page = table_markdown(comparison)
    assert "## Missing: 1 runs" in page
    assert "| low | sac | 0 | killed \\| by SIGSEGV |" in page
    assert "| sac | 1 of 2 |" in page


def test_page_of_nothing_has_no_empty_tables(spec):
    page = table_markdown(compare(spec, [], ""))
    assert "\n| method |" not in page
    assert "## Missing: 6 runs" in page


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


def test_csv_has_a_row_per_cell_and_phase(comparison):
    rows = list(csv.DictReader(io.StringIO(table_csv(comparison))))
    assert len(rows) == len(comparison.cells)
    assert (rows[0]["method"], rows[0]["phase"], rows[0]["ecr"], rows[0]["ofd_runs"]) == (
        "risk-sac",
        "search",
        "0.5",
        "1",
    )
    assert rows[3]["ecr_last"] == ""


def test_versions_that_differ_are_all_named(spec, runs):
    mixed = [replace(runs[0], versions={"numpy": "2.3"}), *runs[1:]]
    assert compare(spec, mixed, "").versions == {"numpy": "2.3, 2.4"}


def test_figures_are_those_that_have_something_to_show(comparison, spec, runs):
    assert set(figure_names(comparison)) == {
        *("ecr_low", "lambda_low", "alpha_low"),
        *(f"bars_{name}{phase}" for name in ("ecr", "es", "rho_c", "ofd") for phase in ("", "_evaluation")),
    }
    control = spec.model_copy(update={"methods": ("no-adversary",)})
    assert "lambda_low" not in figure_names(compare(control, runs, ""))
    assert figure_names(compare(spec, [], "")) == ()


@pytest.mark.parametrize(("format_", "magic"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_the_same_comparison_gives_the_same_picture(comparison, format_, magic):
    picture = figure_bytes(comparison, "ecr_low", format_)
    assert picture.startswith(magic)
    assert picture == figure_bytes(comparison, "ecr_low", format_)


def test_unknown_figure_names_those_there_are(comparison):
    with pytest.raises(ConfigError, match="got 'pie'; wanted one of ecr_low, "):
        figure_bytes(comparison, "pie", "png")


def test_report_is_written_twice_alike(comparison, tmp_path):
    def content():
        write_report(comparison, tmp_path)
        return {path.relative_to(tmp_path): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    first = content()
    assert len(first) == 3 + 2 * len(figure_names(comparison))
    assert content() == first
