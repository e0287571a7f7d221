import itertools
import socket
import subprocess
import sys
import time
from collections import deque
from typing import Any

import pytest

from risk_sac.client import Client, Event, Overdue, Refused, UnexpectedAnswer, Unreachable
from risk_sac.errors import ConfigError
from tests.unit.client.scripted_server import Answer, Server, campaign


def test_lists_are_read_page_by_page_as_far_as_they_are_wanted(server, client):
    pages: list[dict[str, Any]] = [
        {"items": [campaign(id="c3"), campaign(id="c2")], "next": "Mg=="},
        {"items": [campaign(id="c1")], "next": None},
    ]
    for page in pages:
        server.answer(200, page)
    found = client.campaigns(state="running", page=2)
    assert [each.id for each in itertools.islice(found, 2)] == ["c3", "c2"]
    assert len(server.asked) == 1
    assert [each.id for each in found] == ["c1"]
    assert [asked.path for asked in server.asked] == [
        "/v1/campaigns?state=running&limit=2",
        "/v1/campaigns?state=running&limit=2&cursor=Mg%3D%3D",
    ]


def test_the_key_is_sent_with_every_request_and_shown_nowhere(server):
    server.answer(200, campaign())
    with Client(server.url, "rs_secret") as client:
        client.campaign("c1")
        assert "rs_secret" not in repr(client) + str(vars(client))
    assert server.asked[0].headers["authorization"] == "Bearer rs_secret"


def test_a_client_needs_neither_the_method_nor_the_service():
    heavy = {"torch", "libsumo", "botorch", "numba", "fastapi", "sqlalchemy", "service"}
    code = f"import sys, risk_sac.client; print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout == b"[]\n"


@pytest.mark.parametrize(
    "url", ["", "localhost:8000", "ftp://host", "http://", "http://[", "http://host:99999", "a\nb"]
)
def test_what_is_no_url_is_refused(url):
    with pytest.raises(ConfigError, match="wanted http") as caught:
        Client(url)
    assert caught.value.field == "url"


def test_a_password_in_the_url_is_refused_and_not_shown():
    with pytest.raises(ConfigError) as caught:
        Client("http://me:hunter2@host")
    assert "hunter2" not in str(caught.value)


@pytest.mark.parametrize("key", ["", "two words", "line\nbreak", "schlüssel"])
def test_a_key_that_no_header_can_hold_is_refused_and_not_shown(key):
    with pytest.raises(ConfigError) as caught:
        Client(key=key)
    assert not key or key not in str(caught.value)


PROXIES = ("http_proxy", "https_proxy", "all_proxy", "no_proxy")


@pytest.mark.parametrize("proxy", ["http://127.0.0.1:9", "socks5://127.0.0.1:9", "nonsense://x"])
@pytest.mark.parametrize("name", PROXIES[:3])
def test_loopback_is_reached_whatever_proxy_there_is(name, proxy, server, monkeypatch):
    monkeypatch.setenv(name, proxy)
    server.answer(200, campaign())
    for host in ("127.0.0.1", "localhost", "[::ffff:127.0.0.1]"):
        with Client(f"http://{host}:{server.server_port}", patience_s=0.1) as client:
            assert client.campaign("c1").id == "c1"


@pytest.mark.parametrize(("name", "value"), [("all_proxy", "socks5://127.0.0.1:9"), ("https_proxy", "nonsense://x")])
def test_a_proxy_that_cannot_be_used_is_named(name, value, monkeypatch):
    for each in PROXIES:
        monkeypatch.delenv(each, raising=False)
    monkeypatch.setenv(name, value)
    with pytest.raises(ConfigError, match=r"proxy: .*mend HTTP_PROXY"):
        Client("https://search.example")


STATUS, EVENTS = "/v1/campaigns/c1", "/v1/campaigns/c1/events"
RUNNING = 'id: 7\nevent: state\ndata: {"run_id": null, "state": "running", "reason": null}\n\n'
EPISODE = 'id: 8\nevent: episode\ndata: {"run_id": "low-random-0", "index": 0}\n\n'
ENDED = 'id: 9\nevent: state\ndata: {"run_id": null, "state": "succeeded", "reason": null}\n\n'


def script(server: Server, status: list[Answer], *streams: Answer) -> None:
    server.by_path = {STATUS: deque(status), EVENTS: deque(streams)}


def now(state: str, done: int = 0, **headers: str) -> Answer:
    return Answer(200, campaign(state, done), {name.replace("_", "-"): value for name, value in headers.items()})


def test_what_has_not_changed_is_neither_sent_nor_shown_again(server, client):
    unchanged = Answer(304, None, {"ETag": 'W/"1"'})
    script(server, [now("running", ETag='W/"1"'), unchanged, now("running"), now("succeeded", 4)])
    assert [each.state for each in client.follow("c1")] == ["running", "succeeded"]
    assert [each.headers.get("if-none-match") for each in server.asked] == [None, 'W/"1"', 'W/"1"', ""]


def test_a_campaign_that_takes_too_long_is_overdue(server, client):
    script(server, [now("running")])
    before = time.monotonic()
    with pytest.raises(Overdue, match=r"did not end within 0.5 s"):
        client.wait("c1", timeout_s=0.5)
    assert time.monotonic() - before < 5


def test_events_come_as_they_were_sent_and_go_on_after_a_break(server, client):
    script(server, [now("succeeded")], Answer(200, [RUNNING, ": ping\n\n", EPISODE, None]), Answer(200, [ENDED]))
    found = list(client.events("c1"))
    assert [(each.id, each.name) for each in found] == [("7", "state"), ("8", "episode"), ("9", "state")]
    assert found[1] == Event(id="8", name="episode", data={"run_id": "low-random-0", "index": 0})
    assert [each.headers.get("last-event-id") for each in server.asked if each.path == EVENTS] == [None, "8"]


def test_a_stream_that_ends_before_all_is_told_is_taken_up_even_if_the_campaign_has_ended_by_then(server, client):
    script(server, [now("succeeded")], Answer(200, [RUNNING]), Answer(200, [EPISODE, ENDED]))
    assert [each.id for each in client.events("c1")] == ["7", "8", "9"]


PROBLEM = {
    "type": "urn:risk-sac:problem:unprocessable-entity",
    "title": "Unprocessable Entity",
    "status": 422,
    "reason": "invalid_field",
    "detail": "budget.episodes: got 0; wanted >= 1",
    "instance": "/v1/campaigns",
    "errors": [{"field": "budget.episodes", "message": "too small", "got": "0", "wanted": ">= 1"}],
}


def test_a_problem_becomes_an_error_with_reason_detail_and_fields(server, client):
    server.answer(422, PROBLEM)
    with pytest.raises(Refused) as caught:
        client.submit({})
    error = caught.value
    assert (error.status, error.reason, error.detail) == (422, "invalid_field", PROBLEM["detail"])
    assert error.fields[0].field == "budget.episodes"
    assert str(error) == f"{server.url}/v1/campaigns answered 422: {PROBLEM['detail']}"
    assert len(server.asked) == 1


@pytest.mark.parametrize("status", [429, 502, 503, 504])
def test_what_may_pass_is_asked_again(status, server, client):
    server.answer(status, b"<html>of a proxy</html>")
    server.answer(200, campaign())
    assert client.campaign("c1").id == "c1"
    assert len(server.asked) == 2


def test_retry_after_beyond_all_patience_is_an_error_at_once(server, client):
    server.answer(429, PROBLEM | {"status": 429, "reason": "quota_exceeded"}, Retry_After="3600")
    with pytest.raises(Refused) as caught:
        client.submit({})
    assert (caught.value.reason, caught.value.retry_after_s) == ("quota_exceeded", 3600)
    assert len(server.asked) == 1


def test_a_service_that_stays_unwell_is_given_up_in_bounded_time(server, client):
    server.answer(503, PROBLEM | {"status": 503})
    before = time.monotonic()
    with pytest.raises(Refused):
        client.campaign("c1")
    assert time.monotonic() - before < 5
    assert 2 < len(server.asked) < 15


def test_nobody_there_is_an_error_that_names_the_url():
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with (
        Client(f"http://127.0.0.1:{port}", patience_s=0.3) as client,
        pytest.raises(Unreachable, match=f"^http://127.0.0.1:{port} does not answer: .*refused"),
    ):
        client.campaign("c1")


def test_a_lost_answer_is_asked_for_again_under_the_same_key(server, client):
    server.lose()
    server.answer(202, campaign("queued"))
    assert client.submit({"families": ["low"]}).state == "queued"
    first, second = server.asked
    assert first.headers["idempotency-key"] == second.headers["idempotency-key"]
    assert first.body == second.body


def test_a_deletion_whose_answer_is_lost_is_not_repeated(server, client):
    server.lose()
    with pytest.raises(Unreachable):
        client.delete("c1")
    assert [asked.method for asked in server.asked] == ["DELETE"]


def test_a_redirection_is_not_followed_and_the_key_goes_nowhere_else(server):
    server.answer(302, None, Location=f"{server.url}/elsewhere")
    with Client(server.url, "secret") as client, pytest.raises(UnexpectedAnswer, match="answered 302"):
        client.campaign("c1")
    assert len(server.asked) == 1


@pytest.mark.parametrize("body", [b"<html>hello</html>", {"id": "c1"}, b"[1]", b""])
def test_an_answer_of_something_else_is_an_error_and_no_traceback(body, server, client):
    server.answer(200, body)
    with pytest.raises(UnexpectedAnswer, match="is it a RISK-SAC service"):
        client.campaign("c1")


@pytest.mark.parametrize("key", ["schlüssel", "two\nlines", "\udcff"])
def test_what_http_cannot_say_is_an_error_of_the_caller(key, server, client):
    server.answer(202, campaign())
    with pytest.raises(ConfigError):
        client.submit({}, key)
    with pytest.raises(ConfigError, match="wanted text"):
        next(client.campaigns(label="\udcff"))
    assert server.asked == []
