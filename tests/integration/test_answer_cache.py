"""The cache of answers on real servers: no answer is given to the wrong one, nor after something has happened."""

POLLS = 5  # enough for an answer to be given again


def poll(client, path, **headers):
    """The last of several answers, all alike."""
    answers = [client.get(path, headers=headers) for _ in range(POLLS)]
    assert {answer.status_code for answer in answers} == {200}, answers[-1].text
    return answers[-1]


def listed(client, **query):
    return [item["id"] for item in client.get("/v1/campaigns", params=query).json()["items"]]


def test_what_a_client_does_shows_at_once_and_until_then_tags_stay(serve):
    service = serve()
    seen = []
    for label in ("one", "two", "three"):
        seen.insert(0, service.post(label=label, budget={"episodes": 100_000}))
        for _ in range(POLLS):
            assert listed(service.client) == seen
            assert listed(service.client, label=label) == seen[:1]
    campaign = seen[0]
    poll(service.client, f"/v1/campaigns/{campaign}")
    accepted = service.client.post(f"/v1/campaigns/{campaign}/cancel").json()["state"]
    assert accepted in ("cancelling", "cancelled")
    for part in ("", "/results"):
        assert service.get(campaign, part)["state"] in ("cancelling", "cancelled")
    service.wait(campaign)
    poll(service.client, f"/v1/campaigns/{campaign}")
    assert service.client.delete(f"/v1/campaigns/{campaign}").status_code == 204
    assert service.client.get(f"/v1/campaigns/{campaign}").status_code == 404
    assert listed(service.client) == seen[1:]
    for left in seen[1:]:
        service.client.post(f"/v1/campaigns/{left}/cancel")
        service.wait(left)
    answer = poll(service.client, "/v1/campaigns")
    headers = {"If-None-Match": answer.headers["etag"]}
    for _ in range(POLLS):
        unchanged = service.client.get("/v1/campaigns", headers=headers)
        assert (unchanged.status_code, unchanged.content) == (304, b"")
        assert unchanged.headers["etag"] == answer.headers["etag"]
    newest = service.post(budget={"episodes": 1})
    changed = service.client.get("/v1/campaigns", headers=headers)
    assert changed.status_code == 200
    assert [item["id"] for item in changed.json()["items"]] == [newest, *seen[1:]]


def test_each_answer_is_counted_but_only_the_first_of_several_equal_ones_is_logged(shared):
    campaign = shared.wait(shared.post(budget={"episodes": 2}))["id"]
    path, route = f"/v1/campaigns/{campaign}/results", "/v1/campaigns/{campaign_id}/results"
    for expected in (1, 2):
        poll(shared.client, f"{path}?{expected}")
        logged = [line for line in shared.log.read_text().splitlines() if f"GET {route} 200" in line]
        assert [f"[campaign {campaign}]" in line for line in logged] == [True] * expected
    metrics = shared.client.get("/metrics").text.splitlines()
    counter = f'risk_sac_request_seconds_count{{method="GET",route="{route}",status="200"}}'
    assert next(float(line.split()[-1]) for line in metrics if line.startswith(counter)) == 2 * POLLS
