"""Report of a campaign over REST, against `risk_sac.report` on the folders."""

import json
import re
import shlex
import xml.etree.ElementTree as ElementTree
from concurrent.futures import ThreadPoolExecutor

import pytest

from risk_sac import cli
from risk_sac.config import CampaignSpec
from risk_sac.config.spec_file import read_campaign
from risk_sac.report import compare, figure_bytes, figure_names, read_run, table_csv, table_json, table_markdown
from risk_sac.report.figures import FORMATS

SPEC = {
    "methods": ["random", "no-adversary"],
    "seeds": [0, 1],
    "budget": {"episodes": 6, "evaluation_episodes": 1},
    "learner": {"agent": {"actor_learning_rate": 1e-7}},  # which YAML reads as a string where JSON wrote it
}
TYPES = {"json": "application/json", "md": "text/markdown; charset=utf-8", "csv": "text/csv; charset=utf-8"}


@pytest.fixture
def get(service, campaign):
    """Gets a part of the campaign."""
    return lambda part, **options: service.client.get(f"/v1/campaigns/{campaign['id']}{part}", **options)


@pytest.fixture(scope="module")
def comparison(service, campaign):
    """The same comparison made here."""
    folder = service.data_dir / "campaigns" / campaign["id"]
    runs = [read_run(folder / run["id"]) for run in campaign["runs"]]
    base = f"http://127.0.0.1:{service.port}/v1/campaigns"
    return compare(
        CampaignSpec.model_validate_json(json.dumps(campaign["spec"])),
        runs,
        f"curl -s {base}/{campaign['id']}/spec | curl {base} -H 'content-type: application/json' -d @-",
        spec_command=f"curl -s '{base}/{campaign['id']}/spec?format=yaml' -o spec.yaml",
    )


@pytest.mark.parametrize(("name", "made"), [("json", table_json), ("md", table_markdown), ("csv", table_csv)])
def test_table_is_what_the_report_makes_of_the_same_folders(get, comparison, name, made):
    answer = get("/table", params={"format": name})
    assert answer.status_code == 200
    assert answer.headers["content-type"] == TYPES[name]
    assert answer.text == made(comparison)


def test_commands_on_the_page_repeat_a_run_and_the_campaign(get, service, campaign, tmp_path, monkeypatch):
    page = get("/table", params={"format": "md"}).text
    fetch, run = re.findall(r"^(?:curl .* -o spec.yaml|risk-sac run .*)$", page, re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    url = shlex.split(fetch)[2]
    (tmp_path / "spec.yaml").write_text(service.client.get(url).text)
    assert read_campaign(tmp_path / "spec.yaml", {}, {}).digest == get("/table").json()["spec_digest"]
    assert cli.main(shlex.split(run)[1:]) == 0
    assert json.loads((tmp_path / "repeated" / "results.json").read_text())["digest"] in page

    again = service.client.post(
        "/v1/campaigns", content=get("/spec").content, headers={"content-type": "application/json"}
    )
    assert again.status_code == 202, again.text
    assert again.json()["spec"] == campaign["spec"]
    service.client.post(f"{again.headers['location']}/cancel")
    service.wait(again.json()["id"])


def test_figures_asked_for_at_once_are_the_files_of_the_report(get, comparison):
    listed = get("/figures").json()
    assert listed["complete"]
    assert [item["name"] for item in listed["items"]] == list(figure_names(comparison))
    assert all({file["format"] for file in item["files"]} == set(FORMATS) for item in listed["items"])
    files = [file for item in listed["items"][:2] for file in item["files"]]  # each takes a second to draw, twice
    with ThreadPoolExecutor(8) as pool:
        # One is drawn at a time, so on a busy machine the last of eight waits long.
        answers = list(pool.map(lambda file: get(file["href"].partition(listed_at(file))[2], timeout=600), files))
    for file, answer in zip(files, answers, strict=True):
        name = file["href"].rpartition("/")[2].removesuffix(f".{file['format']}")
        assert answer.status_code == 200
        assert answer.headers["content-type"] == file["media_type"]
        assert answer.content == figure_bytes(comparison, name, file["format"])
        if file["format"] == "png":
            assert answer.content.startswith(b"\x89PNG\r\n\x1a\n")
        else:
            assert ElementTree.fromstring(answer.content).tag == "{http://www.w3.org/2000/svg}svg"


def listed_at(file):
    """The part of a link that leads to the campaign."""
    return "/".join(file["href"].split("/")[:4])


def test_table_grows_with_the_runs_and_names_those_that_are_missing(service):
    campaign_id = service.post(methods=["random", "no-adversary"], seeds=[0, 1, 2, 3], budget={"episodes": 2})
    empty = service.client.get(f"/v1/campaigns/{campaign_id}/table")
    assert empty.status_code == 200
    assert (empty.json()["complete"], empty.json()["cells"], len(empty.json()["missing"])) == (False, [], 8)
    assert service.get(campaign_id, "/figures")["items"] == []
    assert service.client.get(f"/v1/campaigns/{campaign_id}/table?format=md").text.startswith("# Comparison")

    service.wait_for(campaign_id, lambda seen: any(run["state"] == "succeeded" for run in seen["runs"]))
    part = service.client.get(f"/v1/campaigns/{campaign_id}/table", headers={"if-none-match": empty.headers["etag"]})
    assert part.status_code == 200
    assert part.json()["cells"]
    assert {run["reason"] for run in part.json()["missing"]} <= {"queued", "running"}

    service.client.post(f"/v1/campaigns/{campaign_id}/cancel")
    ended = service.wait(campaign_id)
    table = service.client.get(f"/v1/campaigns/{campaign_id}/table", headers={"if-none-match": part.headers["etag"]})
    assert table.status_code == 200
    found = {(run["method"], run["seed"]) for run in ended["runs"] if run["state"] == "succeeded"}
    assert {(run["method"], run["seed"]) for run in table.json()["runs"]} == found
    assert len(table.json()["missing"]) == 8 - len(found) > 0
    assert {run["reason"] for run in table.json()["missing"]} == {"cancelled"}
    assert service.get(campaign_id, "/figures")["complete"] is False


def test_run_whose_folder_is_lost_is_named_and_nothing_is_kept_for_later(serve, scripted):
    service = serve()  # its workers leave no results behind
    campaign_id = service.post(seeds=[scripted.WELL_BEHAVED, scripted.EXITS], budget={"episodes": 3})
    service.wait(campaign_id)
    table = service.client.get(f"/v1/campaigns/{campaign_id}/table")
    assert table.status_code == 200
    assert "etag" not in table.headers
    lost, failed = table.json()["missing"]
    assert lost["reason"].startswith("it succeeded, but its results are lost: there is no ")
    assert failed["reason"].startswith("failed: worker exited with status 1: Traceback: the policy is NaN; 5 workers")
