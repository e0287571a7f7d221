"""A disk that fills up or refuses."""

import os
import resource
import subprocess
import sys


def test_a_database_that_cannot_grow_fails_the_campaign_and_stays_readable(serve):
    service = serve()
    earlier = service.post(label="earlier", budget={"episodes": 5})
    service.wait(earlier)
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": 1000})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 3)
    # To a process that may not let any file grow, every write looks like one to a full disk.
    unlimited = resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
    campaign = service.wait(campaign_id)
    assert campaign["state"] == "failed"
    assert campaign["reason"].startswith("storage failed while storing an episode: ")
    assert {run["state"] for run in campaign["runs"]} == {"failed"}
    assert len(service.get(campaign_id, "/episodes")["items"]) > 3
    assert service.get(earlier, "/results")["complete"]
    refused = service.client.post("/v1/campaigns", json={"families": ["low"]})
    assert refused.status_code == 503
    assert refused.json()["detail"].startswith("storage failed while creating a campaign: ")
    assert service.client.get("/healthz").status_code == 200

    resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, unlimited)
    assert service.wait(service.post(budget={"episodes": 2}))["state"] == "succeeded"
    service.wait_until(lambda: service.workers() == [])
    service.stop()
    service.start()
    assert service.get(campaign_id)["reason"] == campaign["reason"]


def test_a_data_folder_that_refuses_fails_the_campaign_and_not_the_server(serve):
    service = serve()
    earlier = service.post(budget={"episodes": 3})
    service.wait(earlier)
    folder = service.data_dir / "campaigns"
    folder.rename(service.data_dir / "kept")
    folder.write_text("in the way")
    campaign = service.wait(service.post())
    assert campaign["state"] == "failed"
    assert campaign["reason"].startswith("storage failed while starting a run: ")
    assert service.get(earlier, "/episodes")["items"]
    folder.unlink()
    assert service.wait(service.post(budget={"episodes": 2}))["state"] == "succeeded"


def test_a_server_without_a_usable_data_folder_says_so(tmp_path):
    (tmp_path / "file").write_text("")
    server = subprocess.run(
        [sys.executable, "-m", "service"],
        env=os.environ | {"RISK_SAC_DATA_DIR": str(tmp_path / "file" / "data"), "RISK_SAC_PORT": "8999"},
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert server.returncode != 0
    assert "wanted a folder that can be written (Not a directory)" in server.stderr
