import socket
import time

import pytest

from risk_sac.client import Client, Refused, UnexpectedAnswer, Unreachable
from risk_sac.errors import ConfigError
from tests.unit.client.scripted_server import Server, campaign

PROBLEM = {
    "type": "urn:risk-sac:problem:unprocessable-entity",
    "title": "Unprocessable Entity",
    "status": 422,
    "reason": "invalid_field",
    "detail": "budget.episodes: got 0; wanted >= 1",
    "instance": "/v1/campaigns",
    "errors": [{"field": "budget.episodes", "message": "too small", "got": "0", "wanted": ">= 1"}],
}


def test_a_problem_becomes_an_error_with_reason_detail_and_fields(server: Server, client: Client) -> None:
    server.answer(422, PROBLEM)
    with pytest.raises(Refused) as caught:
        client.submit({})
    error = caught.value
    assert (error.status, error.reason, error.detail) == (422, "invalid_field", PROBLEM["detail"])
    assert error.fields[0].field == "budget.episodes"
    assert str(error) == f"{server.url}/v1/campaigns answered 422: {PROBLEM['detail']}"
    assert len(server.asked) == 1


@pytest.mark.parametrize("status", [429, 502, 503, 504])
def test_what_may_pass_is_asked_again(status: int, server: Server, client: Client) -> None:
    server.answer(status, b"<html>of a proxy</html>")
    server.answer(200, campaign())
    assert client.campaign("c1").id == "c1"
    assert len(server.asked) == 2


def test_retry_after_beyond_all_patience_is_an_error_at_once(server: Server, client: Client) -> None:
    server.answer(429, PROBLEM | {"status": 429, "reason": "quota_exceeded"}, Retry_After="3600")
    with pytest.raises(Refused) as caught:
        client.submit({})
    assert (caught.value.reason, caught.value.retry_after_s) == ("quota_exceeded", 3600)
    assert len(server.asked) == 1


def test_a_service_that_stays_unwell_is_given_up_in_bounded_time(server: Server, client: Client) -> None:
    server.answer(503, PROBLEM | {"status": 503})
    before = time.monotonic()
    with pytest.raises(Refused):
        client.campaign("c1")
    assert time.monotonic() - before < 5
    assert 2 < len(server.asked) < 15


def test_nobody_there_is_an_error_that_names_the_url() -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with (
        Client(f"http://127.0.0.1:{port}", patience_s=0.3) as client,
        pytest.raises(Unreachable, match=f"^http://127.0.0.1:{port} does not answer: .*refused"),
    ):
        client.campaign("c1")


def test_a_lost_answer_is_asked_for_again_under_the_same_key(server: Server, client: Client) -> None:
    server.lose()
    server.answer(202, campaign("queued"))
    assert client.submit({"families": ["low"]}).state == "queued"
    first, second = server.asked
    assert first.headers["idempotency-key"] == second.headers["idempotency-key"]
    assert first.body == second.body


def test_a_deletion_whose_answer_is_lost_is_not_repeated(server: Server, client: Client) -> None:
    server.lose()
    with pytest.raises(Unreachable):
        client.delete("c1")
    assert [asked.method for asked in server.asked] == ["DELETE"]


def test_a_deletion_that_cannot_have_begun_is_repeated(server: Server, client: Client) -> None:
    server.answer(503)
    server.answer(204)
    client.delete("c1")
    assert len(server.asked) == 2


def test_a_redirection_is_not_followed_and_the_key_goes_nowhere_else(server: Server) -> None:
    server.answer(302, None, Location=f"{server.url}/elsewhere")
    with Client(server.url, "secret") as client, pytest.raises(UnexpectedAnswer, match="answered 302"):
        client.campaign("c1")
    assert len(server.asked) == 1


@pytest.mark.parametrize("body", [b"<html>hello</html>", {"id": "c1"}, b"[1]", b""])
def test_an_answer_of_something_else_is_an_error_and_no_traceback(body: object, server: Server, client: Client) -> None:
    server.answer(200, body)
    with pytest.raises(UnexpectedAnswer, match="is it a RISK-SAC service"):
        client.campaign("c1")


@pytest.mark.parametrize("key", ["schlüssel", "two\nlines", "\udcff"])
def test_what_http_cannot_say_is_an_error_of_the_caller(key: str, server: Server, client: Client) -> None:
    server.answer(202, campaign())
    with pytest.raises(ConfigError):
        client.submit({}, key)
    with pytest.raises(ConfigError, match="wanted text"):
        next(client.campaigns(label="\udcff"))
    assert server.asked == []
