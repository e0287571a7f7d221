"""Studies of replayed failures over REST, with a real server and campaign."""

import signal
import subprocess
import sys
from io import BytesIO

import pytest
from pyarrow import parquet
from shapely import Point, Polygon, union_all

from risk_sac import cli
from risk_sac.client import Client, Refused
from risk_sac.failures.bundle import read_bundle
from risk_sac.failures.export.formats import FORMATS
from risk_sac.failures.question import Question
from risk_sac.run_folder.results import read_results

SPEC = {"families": ["mixed"], "methods": ["archive"], "seeds": [5], "budget": {"episodes": 16}}


@pytest.fixture(scope="module")
def campaign(serve_shared):
    """Server, id of an ended campaign, and one of its failures."""
    service = serve_shared("risk_sac.execution.worker", grace_s=30, replays=2)
    campaign_id = service.post(**SPEC)
    ended = service.wait(campaign_id)
    assert ended["state"] == "succeeded", ended["reason"]
    failure = service.get(campaign_id, "/failures")["items"][0]
    return service, campaign_id, failure


def test_a_bundle_of_a_run_that_learns_nothing_loads_no_torch(campaign, tmp_path):
    service, campaign_id, failure = campaign
    (results,) = service.data_dir.glob(f"campaigns/{campaign_id}/*/results.json")
    found = read_results(results)
    recorded = found.failure(failure["id"])
    series = results.parent / recorded.series
    question = Question(subject="bundle", spec=found.spec, episode=recorded.episode, series=series)
    file = tmp_path / "question.json"
    file.write_text(question.model_dump_json())
    code = f"""
import sys
from pathlib import Path
from risk_sac.failures.study import Question, answer
content = answer(Question.model_validate_json(Path({str(file)!r}).read_bytes()))
print(len(content) > 1000, "torch" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "True False\n"


def test_a_failure_comes_as_a_bundle_with_its_region_and_twins(campaign, tmp_path, monkeypatch):
    service, campaign_id, failure = campaign
    url, id_ = f"http://127.0.0.1:{service.port}", failure["id"]
    monkeypatch.setenv("RISK_SAC_URL", url)
    asked = ["campaigns", "failures", "bundle", campaign_id, str(failure["index"]), "--out"]
    assert cli.main([*asked, str(tmp_path / "failure.npz")]) == 0
    assert cli.main(["replay", str(tmp_path / "failure.npz")]) == 0
    assert cli.main([*asked, str(tmp_path / "likelier.npz"), "--minimise", "most-plausible"]) == 0
    likelier = read_bundle(tmp_path / "likelier.npz")
    assert likelier.manifest.plausible.after <= likelier.manifest.plausible.before
    assert likelier.recorded.manifest.episode.index == failure["index"]

    region = service.get(campaign_id, f"/failures/{id_}/region")
    assert [share["played"] for share in region["shares"]] == [40, 40, 40, 10, 40]
    with Client(url) as client:
        assert client.picture(campaign_id, id_, "perfect").startswith(b"\x89PNG")
        with pytest.raises(Refused) as refused:
            client.picture(campaign_id, id_, "nobody")
        assert refused.value.status == 422

    for name, row in FORMATS.items():
        answer = service.client.get(f"/v1/campaigns/{campaign_id}/failures/{id_}/export", params={"format": name})
        if row.of == "episodes":
            assert answer.status_code == 422
            table = service.client.get(f"/v1/campaigns/{campaign_id}/export", params={"format": name}, timeout=60)
            assert table.headers["content-type"] == row.media_type, table.text
            assert parquet.read_table(BytesIO(table.content)).column("id").to_pylist() == [
                each["id"] for each in service.get(campaign_id, "/episodes?limit=100")["items"]
            ]
            continue
        assert answer.headers["content-type"] == row.media_type, answer.text
        assert answer.headers["content-disposition"].startswith(f'attachment; filename="{id_}')
        if row.suffix == ".zip":
            assert b"beside.json" in answer.content
        else:
            assert answer.content[:4] in (b"\x89MCA", b"GIF8")
    listed = {row["name"]: row["missing"] for row in service.client.get("/v1/formats").json()["items"]}
    assert listed == {name: [] for name in FORMATS}

    own = service.get(campaign_id, f"/failures/{id_}")
    surfaces = service.get(campaign_id, f"/failures/{id_}/roads")["surfaces"]
    ground = union_all([Polygon(surface["outline"]) for surface in surfaces])
    assert all(
        ground.covers(Point(x[0], y[0])) for x, y in zip(own["series"]["x_m"], own["series"]["y_m"], strict=True)
    )
    default, idle = (service.get(campaign_id, f"/failures/{id_}/twins/{twin}") for twin in ("default", "idle"))
    assert default["series"] == own["series"], "the failure's own ego"
    assert default["collision"] == own["collision"]
    hit = own["collision"]
    assert default["outcome"] == f"touches {hit['other_id']} at a closing speed of {hit['relative_speed_mps']:.1f} m/s"
    assert idle["series"]["ids"] == own["series"]["ids"]
    assert idle["series"]["x_m"][0] == own["series"]["x_m"][0], "they begin alike"
    assert (idle["collision"] is None) == (idle["outcome"] == "no contact")

    replayed = [each for each in service.get(campaign_id, "/failures", limit=100)["items"] if each["repetition"]]
    assert all(each["repetition"] == {"times": 2, "same": 2} for each in replayed)
    (run,) = service.get(campaign_id, "/results")["runs"]
    assert run["metrics"]["distinct_failures"] <= len(replayed) == run["verified"]
    assert run["flaky"] == 0

    report = tmp_path / "gate.xml"
    asked = ["campaigns", "regress", campaign_id, "--ego", "default", "--junit", str(report)]
    assert cli.main(asked) == 1  # with its own ego, all of them still fail
    assert report.read_text().count("<failure") == len(replayed)

    clusters = service.get(campaign_id, "/clusters")
    assert clusters["complete"]
    found = clusters["families"]["mixed"]["clusters"]
    metrics = service.get(campaign_id, "/results")["runs"][0]["metrics"]
    assert {cluster["name"]: cluster["failures"] for cluster in found} == metrics["kinds"]
    ids = {each["id"] for each in service.get(campaign_id, "/failures", limit=100)["items"]}
    assert {cluster["representative"] for cluster in found} <= ids


def test_what_cannot_be_regressed_is_refused(campaign):
    service, *_ = campaign

    def refused(status, reason, **body):
        answer = service.client.post("/v1/regressions", json=body)
        assert (answer.status_code, answer.json()["reason"]) == (status, reason)

    refused(404, "unknown_id", campaign_id="c0", ego={})
    refused(422, "invalid_field", campaign_id="c0", ego={"profile": "nobody"})
    refused(422, "invalid_field", campaign_id="../c0", ego={})
    refused(422, "invalid_field", campaign_id="c0", ego={"reaction_time_s": "1"})
    running = service.post(budget={"episodes": 5000})
    refused(409, "not_ended", campaign_id=running, ego={})
    for unknown in ("x", f"{running}-{'0' * 16}", f"{running}-..%2F..%2Fa"):
        assert service.client.get(f"/v1/regressions/{unknown}").status_code == 404
    service.client.post(f"/v1/campaigns/{running}/cancel")


def test_a_regression_outlives_the_server_that_took_it_and_goes_with_its_campaign(campaign):
    service, campaign_id, _ = campaign
    asked = {"campaign_id": campaign_id, "ego": {"profile": "perfect"}}
    posted = service.client.post("/v1/regressions", json=asked)
    assert (posted.status_code, posted.json()["state"]) == (202, "queued")
    path = posted.headers["location"]
    service.stop(signal.SIGKILL)
    service.start()
    service.wait_until(lambda: service.client.get(path).json()["state"] not in ("queued", "running"))
    done = service.client.get(path).json()
    assert done["state"] == "succeeded", done["reason"]
    assert done["passed"] == all(case["verdict"] == "fixed" for case in done["cases"])
    assert len(done["cases"]) == service.get(campaign_id, "/results")["runs"][0]["verified"]
    again = service.client.post("/v1/regressions", json=asked)
    assert (again.status_code, again.json()) == (202, done)
    assert service.client.delete(f"/v1/campaigns/{campaign_id}").status_code == 204
    assert service.client.get(path).status_code == 404
