"""What operators see of the service: health, metrics and its log."""

import json

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


def test_requests_are_counted_by_route_and_what_was_done_outlives_a_restart(serve):
    service = serve()
    campaign_id = service.post(budget={"episodes": 1})
    service.wait(campaign_id)
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
    for _ in range(2):
        assert value(found, "risk_sac_episodes_total", family="low", method="random") == 1
        assert value(found, "risk_sac_runs", state="succeeded") == 1
        service.stop()
        service.start()
        found = samples(service)


def test_a_request_keeps_the_id_it_came_with_and_gets_one_otherwise(client):
    assert client.get("/healthz", headers={"X-Request-ID": "trace-7"}).headers["x-request-id"] == "trace-7"
    made = {
        client.get("/healthz", headers={"X-Request-ID": bad}).headers["x-request-id"] for bad in ("", "a b", "x" * 101)
    }
    assert len(made) == 3
    assert all(len(each) == 16 for each in made)


def test_the_log_names_campaigns_runs_and_routes(serve, scripted):
    service = serve(log_format="json", attempts=2)
    campaign_id = service.post(seeds=[scripted.DIES], budget={"episodes": 4})
    run = f"low-random-{scripted.DIES}"
    service.wait(campaign_id)
    service.client.get("/v1/campaigns", headers={"X-Request-ID": "trace-7"})
    service.stop()
    records = [json.loads(line) for line in service.log.read_text().splitlines()]
    assert {record["level"] for record in records} == {"INFO", "WARNING"}
    assert any(record["logger"] == "uvicorn.error" for record in records)
    assert any((record.get("campaign"), record.get("run")) == (campaign_id, run) for record in records)
    (access,) = [record for record in records if record.get("request_id") == "trace-7"]
    assert (access["method"], access["route"], access["status"]) == ("GET", "/v1/campaigns", 200)
    assert access["ms"] > 0
