"""Calls of a real server: retries, lists, polling, caching, and refusals."""

import asyncio
import json
import time
from collections import Counter

import pytest

SPEC = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 3}}


async def post_at_once(port, keys, spec=SPEC):
    """Posts a campaign with each key concurrently; returns statuses and bodies."""
    body = json.dumps(spec).encode()

    async def post(key):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        await opened.wait()
        head = (
            "POST /v1/campaigns HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nConnection: close\r\n"
        )
        writer.write(f"{head}Idempotency-Key: {key}\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body)
        answer = await reader.read()
        writer.close()
        head, _, content = answer.partition(b"\r\n\r\n")
        return int(head.split()[1]), head.lower(), json.loads(content)

    opened = asyncio.Event()
    posts = [asyncio.create_task(post(key)) for key in keys]
    await asyncio.sleep(1)
    opened.set()
    return await asyncio.gather(*posts)


@pytest.mark.parametrize(("posts", "keys"), [pytest.param(1000, 1, marks=pytest.mark.torture), (100, 10)])
def test_duplicates_at_once_make_one_campaign_for_each_key(serve, posts, keys):
    service = serve(rate_limit=100_000)
    answers = asyncio.run(post_at_once(service.port, [f"retry-{index % keys}" for index in range(posts)]))
    assert Counter(status for status, _, _ in answers) == {202: posts}
    made = {body["id"] for _, _, body in answers}
    assert len(made) == keys
    assert all(f"location: /v1/campaigns/{body['id']}".encode() in head for _, head, body in answers)
    listed = service.client.get("/v1/campaigns", params={"limit": 500}).json()["items"]
    assert {item["id"] for item in listed} == made
    assert len(listed) == keys


def test_a_key_stands_for_one_body_even_after_a_restart(shared):
    header = {"Idempotency-Key": "nightly-2026-11-21"}
    first = shared.client.post("/v1/campaigns", json=SPEC, headers=header)
    shared.stop()
    shared.start()
    again = shared.client.post("/v1/campaigns", json=SPEC | {"seeds": [0]}, headers=header)  # the default, spelt out
    assert (again.status_code, again.headers["location"]) == (202, first.headers["location"])
    other = shared.client.post("/v1/campaigns", json=SPEC | {"seeds": [1]}, headers=header)
    assert other.status_code == 409
    assert other.json()["reason"] == "idempotency_key_reused"
    assert first.json()["id"] in other.json()["detail"]


@pytest.mark.parametrize("key", ["", "x" * 201, "two words", "tab\there", "caf\u00e9"])
def test_a_key_of_another_shape_is_refused(client, key):
    headers = [(b"Idempotency-Key", key.encode("latin-1"))]
    response = client.post("/v1/campaigns", json=SPEC, headers=headers)
    assert response.status_code == 422, key
    assert response.json()["reason"] == "invalid_field"
    assert [error["field"] for error in response.json()["errors"]] == ["Idempotency-Key"]


def test_a_tag_changes_exactly_when_the_body_does(shared):
    campaign = f"/v1/campaigns/{shared.post(budget={'episodes': 20})}"
    bodies: dict[str, dict[str, set[bytes]]] = {campaign: {}, f"{campaign}/results": {}}
    final = {}
    while len(final) < len(bodies):
        for path in bodies.keys() - final.keys():
            response = shared.client.get(path)
            bodies[path].setdefault(response.headers["etag"], set()).add(response.content)
            ended = response.json()["state"] == "succeeded"
            assert ("retry-after" in response.headers) is not ended
            if ended:
                final[path] = response
        time.sleep(0.01)  # there is a limit to the rate of requests
    for path, response in final.items():
        assert len(bodies[path]) > 1
        assert all(len(same) == 1 for same in bodies[path].values())
        tag = response.headers["etag"]
        for sent, status in ((tag, 304), (f'"x", {tag}', 304), ("*", 304), (next(iter(bodies[path])), 200)):
            answer = shared.client.get(path, headers={"If-None-Match": sent})
            assert answer.status_code == status, sent
            assert answer.headers["etag"] == tag
            assert answer.content == (b"" if status == 304 else response.content)
    shared.stop()
    shared.start()
    for path, response in final.items():
        after = shared.client.get(path, headers={"If-None-Match": response.headers["etag"]})
        assert after.status_code == 304


def test_a_project_that_has_queued_enough_is_told_when_to_come_back(serve_inside):
    service = serve_inside(quota_queued_runs=4)
    for seed in (0, 10):
        service.post(seeds=[seed, seed + 1], budget={"episodes": 10_000})
    refused = service.client.post("/v1/campaigns", json=SPEC | {"seeds": [1, 2, 3, 4, 5]})
    assert (refused.status_code, refused.json()["reason"]) == (429, "quota_exceeded")
    assert int(refused.headers["retry-after"]) > 0


POLLS = 5  # enough for an answer to be given again


def poll(client, path, **headers):
    """The last of several answers, all alike."""
    answers = [client.get(path, headers=headers) for _ in range(POLLS)]
    assert {answer.status_code for answer in answers} == {200}, answers[-1].text
    return answers[-1]


def listed(client, **query):
    return [item["id"] for item in client.get("/v1/campaigns", params=query).json()["items"]]


def test_tags_are_posted_replaced_and_asked_for(shared):
    campaign = shared.post(tags=["nightly", "release:2.1"], budget={"episodes": 1})
    path = f"/v1/campaigns/{campaign}"
    tag = poll(shared.client, path).headers["etag"]
    assert listed(shared.client, tag="release:2.1") == [campaign]
    answer = shared.client.put(f"{path}/tags", json={"tags": ["braking"]})
    assert (answer.status_code, answer.json()["tags"]) == (200, ["braking"])
    assert answer.json()["spec"]["tags"] == ["nightly", "release:2.1"]  # as it was posted
    assert poll(shared.client, path).headers["etag"] != tag
    assert (listed(shared.client, tag="nightly"), listed(shared.client, tag="braking")) == ([], [campaign])
    for tags, field in ((["x", "x"], "tags"), (["a,b"], "tags[0]"), (["a"] * 11, "tags")):
        refused = shared.client.put(f"{path}/tags", json={"tags": tags})
        assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, field)
    assert shared.client.get("/v1/campaigns", params={"tag": "a b"}).json()["errors"][0]["field"] == "tag"
    assert shared.get(campaign)["tags"] == ["braking"]


def test_what_a_client_does_shows_at_once_and_until_then_tags_stay(serve):
    service = serve()
    seen = []
    for label in ("one", "two", "three"):
        seen.insert(0, service.post(label=label, budget={"episodes": 100_000}))
        for _ in range(POLLS):
            assert listed(service.client) == seen
            assert listed(service.client, label=label) == seen[:1]
    campaign = seen[0]
    workers = poll(service.client, "/v1/workers").json()
    at_work, waiting = ([run["campaign_id"] for run in workers[part]] for part in ("at_work", "waiting"))
    assert at_work + waiting == seen[::-1]
    assert workers["taken"] == sum(run["slots"] for run in workers["at_work"]) <= workers["slots"]
    assert all(run["silent_s"] < 60 for run in workers["at_work"])
    assert [run["place"] for run in workers["waiting"]] == list(range(1, workers["queued"] + 1))
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
    counter = f'risk_sac_request_seconds_count{{method="GET",route="{route}",status="200"}}'

    def counted():
        metrics = shared.client.get("/metrics").text.splitlines()
        return sum(float(line.split()[-1]) for line in metrics if line.startswith(counter))

    before = counted()
    for expected in (1, 2):
        poll(shared.client, f"{path}?{expected}")
        lines = shared.log.read_text().splitlines()
        assert sum(f"GET {route} 200" in line and f"[campaign {campaign}]" in line for line in lines) == expected
    assert counted() - before == 2 * POLLS


def test_list_of_campaigns_names_the_defects_of_their_egos(client):
    ego = {"driver": "idm-aeb", "defects": ["latency"]}
    posted = client.post("/v1/campaigns", json=SPEC | {"ego": ego})
    assert posted.status_code == 202, posted.text
    rows = {row["id"]: row for row in client.get("/v1/campaigns").json()["items"]}
    assert rows[posted.json()["id"]]["ego"]["defects"] == ["latency"]
