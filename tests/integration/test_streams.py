"""Following campaigns by server-sent events, through broken connections and dying servers."""

import base64
import contextlib
import json
import random
import signal
import socket
import threading
import time

import httpx
import pytest

from tests.server import LONG_S


@pytest.fixture(scope="module")
def shared(striking):
    """See `shared` of the conftest; here with failures."""
    return striking


def events(client, campaign_id, after=None, **asked):
    """Events of one connection, as dictionaries of their fields."""
    headers = {"Last-Event-ID": after} if after else {}
    path = f"/v1/campaigns/{campaign_id}/events"
    with client.stream("GET", path, headers=headers, params=asked, timeout=120) as response:
        if response.status_code == 204:
            return
        assert response.status_code == 200, response.read()
        assert response.headers["content-type"].startswith("text/event-stream")
        event = {}
        for line in response.iter_lines():
            if line:
                name, _, value = line.partition(": ")
                event[name] = value
            else:
                if "data" in event:
                    yield event | {"data": json.loads(event["data"])}
                event = {}


def told(event):
    """What an event is about, without when."""
    data = event["data"]
    return (event["event"], data["run_id"], data.get("id") or data["state"])


def test_a_stream_tells_all_in_order_and_ends_with_the_campaign(shared):
    campaign_id = shared.post(seeds=[0, 1], budget={"episodes": 12})
    seen = list(events(shared.client, campaign_id))
    episodes = [event["data"] for event in seen if event["event"] != "state"]
    listed = shared.get(campaign_id, "/episodes", limit=500)["items"]
    assert episodes == listed
    failures = [event["data"]["id"] for event in seen if event["event"] == "failure"]
    assert failures == [item["id"] for item in shared.get(campaign_id, "/failures", limit=500)["items"]]
    assert len(failures) == 12
    own = [
        event["data"]["funnel"] for event in seen if event["data"]["run_id"] == "low-random-0" and "id" in event["data"]
    ]
    assert own[1] == own[2] == {"contacts": 1, "valid": 1, "distinct": 1, "preventable": 1, "published": 1}
    assert own[-1] == {"contacts": 6, "valid": 6, "distinct": 4, "preventable": 2, "published": 2}
    assert seen[-1]["event"] == "state"
    assert (seen[-1]["data"]["run_id"], seen[-1]["data"]["state"]) == (None, "succeeded")
    for run in ("low-random-0", "low-random-1"):
        own = [told(event) for event in seen if event["data"]["run_id"] == run]
        assert own[0] == ("state", run, "running")
        assert own[-1] == ("state", run, "succeeded")
        assert len(own) == 14
    assert len({event["id"] for event in seen}) == len(seen)


def test_a_stream_taken_up_after_any_event_tells_exactly_the_rest(shared):
    campaign_id = shared.post(seeds=[0, 1, 2], budget={"episodes": 5})
    seen = list(events(shared.client, campaign_id))
    for index, event in enumerate(seen):
        assert list(events(shared.client, campaign_id, event["id"])) == seen[index + 1 :]
    path = f"/v1/campaigns/{campaign_id}/events"
    over = shared.client.get(path, headers={"Last-Event-ID": seen[-1]["id"]})
    assert (over.status_code, over.content) == (204, b"")


def test_a_stream_begins_with_as_many_of_the_newest_events_as_are_asked_for(shared):
    campaign_id = shared.post(budget={"episodes": 5})
    seen = list(events(shared.client, campaign_id))
    for newest in (1, 3, len(seen), 1000):
        assert list(events(shared.client, campaign_id, newest=newest)) == seen[-newest:]
    assert list(events(shared.client, campaign_id, newest=0)) == []  # it has ended: nothing comes any more
    assert list(events(shared.client, campaign_id, seen[1]["id"], newest=1)) == seen[2:]


def test_a_stream_of_what_comes_tells_all_that_comes(shared):
    campaign_id = shared.post(budget={"episodes": 10_000})
    whole, tail = events(shared.client, campaign_id), events(shared.client, campaign_id, newest=0)
    first = next(tail)
    with httpx.Client(base_url=shared.client.base_url, timeout=600) as other:
        other.post(f"/v1/campaigns/{campaign_id}/cancel")
    told_all = list(whole)
    assert [first, *tail] == told_all[told_all.index(first) :]


@pytest.mark.parametrize("kills", [2, pytest.param(5, marks=pytest.mark.torture)])
def test_streams_through_killed_servers_tell_everything_once(serve, kills):
    """Clients resume from their last id while the server is repeatedly killed."""
    service = serve("striking_worker")
    episodes = 40 * kills
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": episodes})
    seen = [[] for _ in range(4)]

    def follow(mine):
        with httpx.Client(base_url=service.client.base_url, timeout=600) as client:
            while not (mine and told(mine[-1]) == ("state", None, "succeeded")):
                with contextlib.suppress(httpx.TransportError):
                    for event in events(client, campaign_id, mine[-1]["id"] if mine else None):
                        mine.append(event)  # one by one: what arrived before the connection broke counts
                time.sleep(0.05)

    followers = [threading.Thread(target=follow, args=(mine,), daemon=True) for mine in seen]
    for follower in followers:
        follower.start()
    chance = random.Random(5)
    for _ in range(kills):
        time.sleep(chance.uniform(0.5, 2.0))
        service.stop(signal.SIGKILL)
        service.start()
    service.wait(campaign_id)
    for follower in followers:
        follower.join(LONG_S)
        assert not follower.is_alive()
    listed = [item["id"] for item in service.get(campaign_id, "/episodes", limit=500)["items"]]
    assert len(listed) == 2 * episodes
    for mine in seen:
        assert [event["data"]["id"] for event in mine if event["event"] != "state"] == listed
        assert len({event["id"] for event in mine}) == len(mine)
        assert mine == seen[0]
        assert ("state", "low-random-0", "queued") in map(told, mine)  # a server that died put it back


def test_an_id_that_was_never_given_is_refused(shared):
    mine, other = (shared.post(budget={"episodes": 2}) for _ in range(2))
    theirs = list(events(shared.client, other))[3]["id"]
    shared.wait(mine)
    wrong = ["1", "-1.-1", "999999.1", "1.999999", "99999999999999999999.1", "\u0661.\u0661", "1.1.1", "1.1\n"]
    wrong += [f"{mine}-{number}" for number in ("0", "-1", "7", "999999", "99999999999999999999", "\u0661", "1\n", "")]
    for forged in ["0", "x" * 101, "caf%C3%A9", theirs, *(base64.b64encode(text.encode()).decode() for text in wrong)]:
        response = shared.client.get(f"/v1/campaigns/{mine}/events", headers={"Last-Event-ID": forged})
        assert response.status_code == 422, forged
        assert response.json()["reason"] == "invalid_field"
        assert [error["field"] for error in response.json()["errors"]] == ["Last-Event-ID"]


def test_a_stream_ends_when_its_campaign_is_deleted(shared):
    campaign_id = shared.post(budget={"episodes": 10_000})
    stream = events(shared.client, campaign_id)
    next(stream)
    with httpx.Client(base_url=shared.client.base_url, timeout=600) as other:
        other.post(f"/v1/campaigns/{campaign_id}/cancel")
        assert told(list(stream)[-1]) == ("state", None, "cancelled")
        shared.wait_until(lambda: other.delete(f"/v1/campaigns/{campaign_id}").status_code == 204)
    assert shared.client.get(f"/v1/campaigns/{campaign_id}/events").status_code == 404


def test_a_server_with_open_streams_stops_in_time(serve):
    """Some of them do not even read."""
    service = serve("striking_worker")
    campaign_id = service.post(seeds=[0, 1], budget={"episodes": 10_000})
    request = f"GET /v1/campaigns/{campaign_id}/events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    with contextlib.ExitStack() as stack:
        streams = [stack.enter_context(socket.create_connection(("127.0.0.1", service.port))) for _ in range(50)]
        for stream in streams:
            stream.sendall(request)
            assert stream.recv(15) == b"HTTP/1.1 200 OK"
        began = time.monotonic()
        service.process.send_signal(signal.SIGTERM)
        received = b"".join(iter(lambda: streams[0].recv(65536), b""))
        service.process.wait(30)
        assert time.monotonic() - began < 20
    assert received.endswith(b"0\r\n\r\n")  # the last chunk: it ended, it did not break
    assert "Traceback" not in service.log.read_text()
