import time
from collections import deque

import pytest

from risk_sac.client import Client, Event, Overdue, Refused
from tests.unit.client.scripted_server import Answer, Server, campaign

STATUS, EVENTS = "/v1/campaigns/c1", "/v1/campaigns/c1/events"
RUNNING = 'id: 7\nevent: state\ndata: {"run_id": null, "state": "running", "reason": null}\n\n'
EPISODE = 'id: 8\nevent: episode\ndata: {"run_id": "low-random-0", "index": 0}\n\n'
ENDED = 'id: 9\nevent: state\ndata: {"run_id": null, "state": "succeeded", "reason": null}\n\n'


def script(server: Server, status: list[Answer], *streams: Answer) -> None:
    server.by_path = {STATUS: deque(status), EVENTS: deque(streams)}


def now(state: str, done: int = 0, **headers: str) -> Answer:
    return Answer(200, campaign(state, done), {name.replace("_", "-"): value for name, value in headers.items()})


def test_what_has_not_changed_is_neither_sent_nor_shown_again(server: Server, client: Client) -> None:
    unchanged = Answer(304, None, {"ETag": 'W/"1"'})
    script(server, [now("running", ETag='W/"1"'), unchanged, now("running"), now("succeeded", 4)])
    assert [each.state for each in client.follow("c1")] == ["running", "succeeded"]
    assert [each.headers.get("if-none-match") for each in server.asked] == [None, 'W/"1"', 'W/"1"', ""]


def test_a_campaign_that_takes_too_long_is_overdue(server: Server, client: Client) -> None:
    script(server, [now("running")])
    before = time.monotonic()
    with pytest.raises(Overdue, match=r"did not end within 0.5 s"):
        client.wait("c1", timeout_s=0.5)
    assert time.monotonic() - before < 5


def test_a_campaign_deleted_meanwhile_is_an_error(server: Server, client: Client) -> None:
    script(server, [now("running"), Answer(404, {"detail": "no campaign", "reason": "unknown_id"})])
    with pytest.raises(Refused, match="no campaign"):
        client.wait("c1")


def test_events_come_as_they_were_sent_and_go_on_after_a_break(server: Server, client: Client) -> None:
    script(server, [now("succeeded")], Answer(200, [RUNNING, ": ping\n\n", EPISODE, None]), Answer(200, [ENDED]))
    found = list(client.events("c1"))
    assert [(each.id, each.name) for each in found] == [("7", "state"), ("8", "episode"), ("9", "state")]
    assert found[1] == Event(id="8", name="episode", data={"run_id": "low-random-0", "index": 0})
    assert [each.headers.get("last-event-id") for each in server.asked if each.path == EVENTS] == [None, "8"]


def test_a_stream_that_ends_before_all_is_told_is_taken_up_even_if_the_campaign_has_ended_by_then(
    server: Server, client: Client
) -> None:
    script(server, [now("succeeded")], Answer(200, [RUNNING]), Answer(200, [EPISODE, ENDED]))
    assert [each.id for each in client.events("c1")] == ["7", "8", "9"]
