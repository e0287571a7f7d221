"""A service whose file of keys is lost stays closed until an administrator opens it."""

import httpx
import pytest

from service.keys.__main__ import main

NEEDS_KEY = (
    ("GET", "/v1/campaigns"),
    ("GET", "/metrics"),
    ("GET", "/v1/families"),
    ("GET", "/v1/networks"),
    ("POST", "/v1/campaigns"),
)


def create(service, capsys, *arguments):
    """A client with a new key."""
    assert main(["create", "--project", "maps", *arguments]) == 0
    headers = {"authorization": f"Bearer {capsys.readouterr().out.strip()}"}
    return httpx.Client(base_url=service.client.base_url, headers=headers, timeout=120)


def statuses(client, campaign):
    asked = (*NEEDS_KEY, ("DELETE", f"/v1/campaigns/{campaign}"))
    answers = [client.request(method, path) for method, path in asked]
    assert all(answer.json()["reason"] == "keys_unavailable" for answer in answers if answer.status_code == 503)
    return {answer.status_code for answer in answers}


@pytest.mark.parametrize("serve", ["sqlite", pytest.param("postgresql", marks=pytest.mark.torture)], indirect=True)
def test_lost_keys_open_nothing(serve, monkeypatch, capsys):
    service = serve()
    for name in ("RISK_SAC_DATA_DIR", "RISK_SAC_DATABASE_URL"):
        if name in service.environment:
            monkeypatch.setenv(name, service.environment[name])
    campaign = service.wait(service.post(budget={"episodes": 1}))["id"]
    with create(service, capsys) as holder:
        assert holder.get("/v1/campaigns").status_code == 200
        (service.data_dir / "keys.json").unlink()
        for restarted in (False, True):
            if restarted:
                service.stop()
                for path in service.data_dir.glob("keys.*"):
                    path.unlink()
                service.start()
            for client in (service.client, holder):
                assert statuses(client, campaign) == {503}
            assert service.client.get("/healthz").status_code == 200
            assert service.client.get("/openapi.json").status_code == 200
        assert "is missing, although keys were made; restore their file from a copy" in service.log.read_text()
        assert main(["create", "--project", "maps"]) == 1
        with create(service, capsys, "--replace-file") as new:
            assert new.get("/v1/campaigns").status_code == 200
            assert holder.get("/v1/campaigns").status_code == 401
            assert service.client.get("/v1/campaigns").status_code == 401
    with pytest.raises(SystemExit, match="2"):
        main(["open"])
    assert service.client.get("/v1/campaigns").status_code == 401
    assert main(["open", "--yes"]) == 0
    assert [each["id"] for each in service.client.get("/v1/campaigns").json()["items"]] == [campaign]
    (service.data_dir / "keys.json").unlink()
    assert statuses(service.client, campaign) == {503}
