"""Campaign with an i.i.d. phase, and its report, by service and CLI."""

import json
import resource
import signal

import pytest

from risk_sac import cli
from risk_sac.records.assessment import CellState, CoverageMatrix
from risk_sac.report.document import CampaignEvidence
from risk_sac.run_folder.results import read_results

LABEL = "night <script>alert(1)</script>"
SPEC = {
    "label": LABEL,
    "families": ["mixed"],  # its headline candidates come early
    "methods": ["archive"],
    "seeds": [601],
    "budget": {"episodes": 40},
    "iid": {"episodes": 5, "seed": 3},
}
RUNS = ["mixed-archive-601", "mixed-iid-undisturbed-3", "mixed-iid-random-3"]


@pytest.fixture
def folders(service, campaign):
    return [str(service.data_dir / "campaigns" / campaign["id"] / run) for run in RUNS]


def test_its_runs_end_the_campaign_and_are_in_no_count_of_the_search(service, campaign, folders):
    assert [run["id"] for run in campaign["runs"]] == RUNS
    assert campaign["methods"] == ["archive"]
    assert campaign["progress"]["episodes_done"] == 50
    search = read_results(service.data_dir / "campaigns" / campaign["id"] / RUNS[0]).metrics
    assert campaign["progress"]["raw_collisions"] == search.raw_collisions > 0
    (total,) = service.get(campaign["id"], "/results")["totals"]
    assert (total["method"], total["episodes"]) == ("archive", 40)
    found = service.get(campaign["id"], "/failures", tier="raw", limit=500)["items"]
    assert {each["run_id"] for each in found} == {RUNS[0]}
    assert service.get(campaign["id"], "/clusters")["complete"]
    drawn = service.get(campaign["id"], "/episodes", run=RUNS[2])["items"]
    assert [(each["phase"], each["index"]) for each in drawn] == [("iid", index) for index in range(5)]


def test_the_report_has_bounds_of_the_i_i_d_phase_alone(service, campaign):
    told = service.get(campaign["id"], "/report")
    evidence = CampaignEvidence.model_validate(told)
    assert evidence.complete
    assert [(each.method, each.played + each.refused) for each in evidence.bounds] == [
        ("iid-undisturbed", 5),
        ("iid-random", 5),
    ]
    assert evidence.coverage["mixed"].search.episodes + campaign["progress"]["rejected"] == 40
    first = evidence.bounds[0].failures
    assert (first.count, first.low) == (0, 0.0)
    assert first.high == pytest.approx(1 - 0.05 ** (1 / evidence.bounds[0].played))


def test_the_page_may_run_and_load_nothing_and_a_client_that_has_it_is_told_so(service, campaign, tmp_path):
    path = f"/v1/campaigns/{campaign['id']}/report"
    page = service.client.get(path, params={"format": "html"})
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["content-security-policy"].startswith("default-src 'none'; img-src data:;")
    assert "Search results are no crash rate" in page.text
    assert "<script" not in page.text
    assert "&lt;script&gt;" in page.text
    assert "data:image/svg+xml;base64," in page.text
    assert f"/v1/campaigns/{campaign['id']}/spec" in page.text
    assert str(service.data_dir) not in page.text
    out = tmp_path / "report.html"
    url = str(service.client.base_url)
    assert cli.main(["campaigns", "report", campaign["id"], "--out", str(out), "--url", url]) == 0
    assert out.read_text() == service.client.get(path, params={"format": "html"}).text
    assert cli.main(["campaigns", "report", campaign["id"], "--out", str(tmp_path / "x.pdf"), "--url", url]) == 2
    unchanged = service.client.get(path, params={"format": "html"}, headers={"if-none-match": page.headers["etag"]})
    assert unchanged.status_code == 304
    text = service.client.get(path, params={"format": "md"})
    assert text.text.startswith("# Failures of an ego: night &lt;script&gt;")
    assert text.headers["etag"] != page.headers["etag"]
    assert service.client.get(path, params={"format": "pdf"}).status_code == 422


def test_coverage_names_the_campaigns_behind_each_cell(service, campaign):
    own = CoverageMatrix.model_validate(service.get(campaign["id"], "/coverage"))
    assert [(one.id, one.label, one.complete) for one in own.campaigns] == [(campaign["id"], LABEL, True)]
    played = {cell.campaigns for group in own.groups for row in group.rows for cell in row.cells if cell.played}
    assert played == {(campaign["id"],)}
    of_label = service.client.get("/v1/coverage", params={"label": LABEL, "ego": "default"})
    assert of_label.status_code == 200
    assert CoverageMatrix.model_validate(of_label.json()) == own
    nothing = CoverageMatrix.model_validate(service.client.get("/v1/coverage", params={"ego": "x"}).json())
    assert (nothing.campaigns, nothing.cells[CellState.PLAYED]) == ((), 0)
    assert service.client.get("/v1/coverage", params={"limit": 0}).status_code == 422


def test_the_report_has_a_test_case_and_who_judged_it(service, campaign):
    case = CampaignEvidence.model_validate(service.get(campaign["id"], "/report")).cases[0]
    assert (case.scenario, case.result.episodes, case.judged_by.people) == ("mixed", 40, {})
    assert {run.id for run in case.recording} == set(RUNS)
    assert [requirement.name for requirement in case.pass_criteria][:2] == ["no_contact", "on_carriageway"]


def test_a_regression_of_the_campaign_is_told_in_it_and_no_other(service, campaign):
    path = f"/v1/campaigns/{campaign['id']}/report"
    for unknown in ("x", f"{campaign['id']}-{'0' * 16}", f"c0123-{'0' * 16}"):
        assert service.client.get(path, params={"regression": unknown}).status_code == 404
    posted = {"campaign_id": campaign["id"], "ego": {"profile": "perfect"}}
    regression = service.client.post("/v1/regressions", json=posted).json()
    where = f"/v1/regressions/{regression['id']}"
    service.wait_until(lambda: service.client.get(where).json()["state"] not in ("queued", "running"))
    assert service.client.get(where).json()["state"] == "succeeded"
    told = service.client.get(path, params={"regression": regression["id"], "format": "md"}).text
    assert "profile perfect" in told
    for case in service.client.get(where).json()["cases"]:
        assert f"| {case['id']} |" in told


def test_the_command_line_says_the_same_of_the_same_folders(service, campaign, folders, tmp_path, capsys):
    out = tmp_path / "new" / "report"
    for suffix in (".json", ".html", ".md"):
        assert cli.main(["report", *folders, "--out", str(out.with_suffix(suffix))]) == 0
    told = json.loads(out.with_suffix(".json").read_text())
    here, there = (CampaignEvidence.model_validate(found) for found in (told, service.get(campaign["id"], "/report")))
    for name in ("complete", "headline", "bounds", "coverage", "cells", "kinds", "power", "clauses", "figures"):
        assert getattr(here, name) == getattr(there, name)
    digests = [{one.name: one.sha256 for one in evidence.signed.inputs} for evidence in (here, there)]
    assert {name for name in digests[0] if digests[0][name] != digests[1].get(name)} == {"campaign"}  # has no label
    assert cli.main(["report", "verify", str(out.with_suffix(".html")), *folders]) == 0
    page = out.with_suffix(".html").read_text()
    assert "data:image/svg+xml;base64," in page
    assert f"risk-sac show {folders[0]} " in page
    assert page.count("<h2 ") == out.with_suffix(".md").read_text().count("\n## ")
    assert cli.main(["report", folders[1], "--out", str(out.with_suffix(".md"))]) == 2
    assert "only runs of an i.i.d. phase" in capsys.readouterr().err


def test_a_full_disk_leaves_the_report_that_was_there_and_nothing_half_written(folders, tmp_path, capsys):
    out = tmp_path / "report.html"
    out.write_text("the one before")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
        status = cli.main(["report", *folders, "--out", str(out)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert status == 1
    assert "File too large" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]
    assert out.read_text() == "the one before"
