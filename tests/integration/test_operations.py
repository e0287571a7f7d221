"""What those who run the service see of it: health, metrics, and its log."""

import json
import resource

import pytest
from prometheus_client.parser import text_string_to_metric_families


def samples(service):
    response = service.client.get("/metrics")
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/plain; version=")
    families = text_string_to_metric_families(response.text)
    return {
        (sample.name, *sorted(sample.labels.items())): sample.value for family in families for sample in family.samples
    }


def value(found, name, **labels):
    return found.get((name, *sorted(labels.items())), 0.0)


def test_metrics_count_what_was_done_and_survive_a_restart(serve):
    service = serve("striking_worker")
    service.wait(service.post(budget={"episodes": 6}))
    done = {"family": "low", "method": "random"}
    for _ in range(2):
        found = samples(service)
        assert value(found, "risk_sac_episodes_total", **done) == 6
        assert value(found, "risk_sac_failures_total", **done) == 3
        assert value(found, "risk_sac_runs", state="succeeded") == 1
        service.stop()
        service.start()


def test_a_lost_worker_is_counted_by_cause(serve, scripted):
    service = serve(attempts=2)
    service.wait(service.post(seeds=[scripted.DIES], budget={"episodes": 6}))
    assert value(samples(service), "risk_sac_worker_restarts_total", cause="killed") > 0


def test_requests_are_counted_by_route_whatever_was_asked_for(serve):
    service = serve()
    campaign_id = service.post(budget={"episodes": 1})
    tag = service.client.get(f"/v1/campaigns/{campaign_id}/spec").headers
    assert "x-request-id" in tag
    for path in ("/nothing", "/v1/none/whatever", "/%00"):
        assert service.client.get(path).status_code == 404
    service.client.put(f"/v1/campaigns/{campaign_id}")
    service.client.get("/v1/campaigns/none")
    found = samples(service)

    def count(route, method, status):
        return value(found, "risk_sac_request_seconds_count", route=route, method=method, status=status)

    assert count("/v1/campaigns", "POST", "202") == 1
    assert count("/v1/campaigns/{campaign_id}/spec", "GET", "200") == 1
    assert count("/v1/campaigns/{campaign_id}", "GET", "404") == 1
    assert count("unknown", "GET", "404") == 3
    routes = {dict(key[1:])["route"] for key in found if key[0] == "risk_sac_request_seconds_count"}
    assert campaign_id not in "".join(routes)


def test_an_idle_service_is_healthy_and_ready(client):
    assert client.get("/healthz").json() == {"status": "ok"}
    assert client.get("/readyz").json() == {"status": "ready"}


def test_a_service_whose_disk_refuses_is_alive_and_not_ready(serve):
    service = serve()
    campaign_id = service.post(budget={"episodes": 10_000})
    service.wait_for(campaign_id, lambda seen: seen["progress"]["episodes_done"] > 3)
    # To a process that may not let any file grow, every write looks like one to a full disk.
    unlimited = resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
    service.wait_until(lambda: service.client.get("/readyz").status_code == 503)
    refused = service.client.get("/readyz").json()
    assert refused["reason"] == "storage_unavailable"
    assert refused["detail"].startswith("storage failed while ")
    assert service.client.get("/healthz").status_code == 200
    assert value(samples(service), "risk_sac_storage_available") == 0
    resource.prlimit(service.process.pid, resource.RLIMIT_FSIZE, unlimited)
    service.wait_until(lambda: service.client.get("/readyz").status_code == 200)


def test_a_request_keeps_the_id_it_came_with_and_gets_one_otherwise(client):
    assert client.get("/healthz", headers={"X-Request-ID": "trace-7"}).headers["x-request-id"] == "trace-7"
    made = {
        client.get("/healthz", headers={"X-Request-ID": bad}).headers["x-request-id"] for bad in ("", "a b", "x" * 101)
    }
    assert len(made) == 3
    assert all(len(each) == 16 for each in made)


@pytest.mark.parametrize("log_format", ["json", "text"])
def test_the_log_names_campaigns_runs_and_routes(serve, scripted, log_format):
    service = serve(log_format=log_format, attempts=2)
    campaign_id = service.post(seeds=[scripted.DIES], budget={"episodes": 4})
    run = f"low-random-{scripted.DIES}"
    service.wait(campaign_id)
    service.client.get("/v1/campaigns", headers={"X-Request-ID": "trace-7"})
    service.stop()
    lines = service.log.read_text().splitlines()
    if log_format == "text":
        assert any(line.endswith(f"[campaign {campaign_id}, run {run}]") for line in lines)
        assert any("service.access: GET /v1/campaigns 200 " in line for line in lines)
        return
    records = [json.loads(line) for line in lines]
    assert {record["level"] for record in records} == {"INFO", "WARNING"}
    assert any(record["logger"] == "uvicorn.error" for record in records)
    assert any((record.get("campaign"), record.get("run")) == (campaign_id, run) for record in records)
    (access,) = [record for record in records if record.get("request_id") == "trace-7"]
    assert (access["method"], access["route"], access["status"]) == ("GET", "/v1/campaigns", 200)
    assert access["ms"] > 0
