"""Limits of a local server: rates, body sizes, lost keys and addresses."""

import itertools
import os
import socket
import subprocess
import sys
import time

import httpx
import pytest

from service.keys import KeyFile, Scope
from service.settings import ServiceSettings
from tests.contract.serving import serving
from tests.server import LONG_S

PROBLEM = "application/problem+json"
SPEC = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 4}}


@pytest.fixture(scope="module")
def strict(serve_shared, tmp_path_factory):
    """A server of this machine alone, with low limits and no keys."""
    folder = tmp_path_factory.mktemp("strict")
    limits = {"max_body_bytes": "2048", "max_upload_bytes": "4096", "rate_limit": "20"}
    return serve_shared(data_dir=folder, **limits)


def forget(service):
    """Removes all keys, and that there were any."""
    for path in service.data_dir.glob("keys.*"):
        path.unlink()


def at_once(ask, count=60):
    """Returns answers to `count` requests, made within two of the server's seconds."""
    while True:  # a busy machine takes several tries
        time.sleep(1.1)  # the server has forgotten what came before
        began = int(time.monotonic())
        answers = [ask() for _ in range(count)]
        if int(time.monotonic()) <= began + 1:
            return answers


@pytest.fixture
def calm(strict):
    """A client of the strict server, in a second of its own."""
    time.sleep(1.1)
    return strict.client


def test_on_loopback_nobody_needs_a_key_until_there_is_one(strict, calm):
    campaign = strict.post(budget={"episodes": 1})
    assert calm.get("/metrics").status_code == 200
    file = KeyFile(strict.data_dir / "keys.json")
    key, token = file.create("maps", "", Scope.ADMIN)
    assert calm.get("/v1/campaigns").status_code == 401
    with_key = {"authorization": f"Bearer {token}"}
    assert calm.get(f"/v1/campaigns/{campaign}", headers=with_key).json()["id"] == campaign
    file.revoke(key.id)
    assert calm.get("/v1/campaigns").status_code == 401, "revoking the last key opens nothing"
    file.path.unlink()
    refused = calm.get("/v1/campaigns")
    assert (refused.status_code, refused.json()["reason"]) == (503, "keys_unavailable"), "nor does losing them"
    forget(strict)
    assert calm.get("/v1/campaigns").status_code == 200


@pytest.mark.parametrize(
    ("trusted", "stated", "status"),
    [
        (["127.0.0.1"], ["203.0.113.9"], 401),
        (["127.0.0.1"], ["127.0.0.1, 203.0.113.9"], 401),  # the client has forged the first
        (["127.0.0.1"], ["2001:db8::7"], 401),
        (["127.0.0.1"], ["unknown"], 401),
        (["127.0.0.1"], ["203.0.113.9", "127.0.0.1"], 401),  # headers, not addresses of one
        (["*"], ["127.0.0.1, 203.0.113.9"], 401),
        ([], ["203.0.113.9"], 401),
        (["127.0.0.1"], ["127.0.0.1"], 200),
        (["127.0.0.1"], ["::1"], 200),
        (["127.0.0.1"], [], 200),
    ],
)
def test_without_a_key_a_proxy_lets_in_its_clients_on_loopback_alone(tmp_path, trusted, stated, status):
    with serving(ServiceSettings(data_dir=tmp_path, trusted_proxies=trusted)) as url:
        answer = httpx.get(f"{url}/metrics", headers=[("x-forwarded-for", each) for each in stated], timeout=LONG_S)
        assert answer.status_code == status
        if status == 401:
            assert (answer.headers["content-type"], answer.json()["reason"]) == (PROBLEM, "unauthorized")
            assert "`risk-sac keys create`" in answer.json()["detail"]


def test_without_keys_hosts_and_origins_are_checked_too(calm):
    assert calm.get("/v1/campaigns", headers={"host": "rebound.example"}).status_code == 421
    assert calm.post("/v1/campaigns", json=SPEC, headers={"origin": "http://evil.example"}).status_code == 403
    assert calm.options("/v1/campaigns", headers={"origin": "http://evil.example"}).status_code == 405


def test_who_asks_too_often_waits(calm):
    answers = at_once(lambda: calm.get("/v1/methods"))
    late = [answer for answer in answers if answer.status_code == 429]
    assert 20 <= len(late) <= 40, "20 of each second get through"
    assert late[0].json()["reason"] == "rate_limited"
    assert late[0].headers["retry-after"] == "1"
    assert calm.get("/healthz").status_code == 200, "health is not for the rate to hide"
    time.sleep(1)
    assert calm.get("/v1/methods").status_code == 200


def test_keys_are_counted_apart_and_guesses_by_address(strict, calm):
    file = KeyFile(strict.data_dir / "keys.json")
    tokens = [file.create("maps", "", Scope.READ)[1] for _ in range(2)]
    busy, idle = ({"authorization": f"Bearer {token}"} for token in tokens)
    try:
        assert 429 in {answer.status_code for answer in at_once(lambda: calm.get("/v1/methods", headers=busy))}
        assert calm.get("/v1/methods", headers=idle).status_code == 200
        guess = {"authorization": f"Bearer {tokens[0][:-1]}!"}
        guesses = at_once(lambda: calm.get("/v1/methods", headers=guess))
        assert {answer.status_code for answer in guesses} == {401, 429}
        assert calm.get("/v1/methods", headers=idle).status_code == 200
    finally:
        forget(strict)


def test_a_header_hides_no_guess_from_the_limit(strict, calm):
    KeyFile(strict.data_dir / "keys.json").create("maps", "", Scope.READ)
    addresses = itertools.count()

    def guess():
        address = f"10.0.0.{next(addresses)}"
        headers = {"x-forwarded-for": address, "forwarded": f"for={address}", "x-real-ip": address}
        return calm.get("/v1/methods", headers=headers)

    try:
        assert {answer.status_code for answer in at_once(guess)} == {401, 429}
    finally:
        forget(strict)


def parts(size):
    """A body that does not say how large it is."""
    for _ in range(0, size, 512):
        yield b" " * 512


@pytest.mark.parametrize(
    ("path", "content_type", "limit"),
    [("/v1/campaigns", "application/json", 2048), ("/v1/networks", "application/xml", 4096)],
)
def test_too_large_a_body_is_refused_and_the_connection_goes_on(strict, path, content_type, limit):
    time.sleep(1.1)
    headers = {"content-type": content_type}
    with httpx.Client(base_url=strict.client.base_url, limits=httpx.Limits(max_connections=1)) as one:
        for body in (b" " * (limit + 1), b" " * (1 << 20), parts(limit + 512), parts(1 << 20)):
            response = one.post(path, content=body, headers=headers)
            assert response.status_code == 413, response.text
            assert response.headers["content-type"] == PROBLEM
            assert response.json()["reason"] == "too_large"
            assert str(limit) in response.json()["detail"]
            assert one.get("/v1/methods").status_code == 200
        for body in (b" " * limit, parts(limit)):
            assert one.post(path, content=body, headers=headers).status_code in (400, 422), "just not too large"
    assert not list(strict.data_dir.glob("networks/.incoming/*"))


def test_an_endless_body_is_refused_before_it_ends(strict):
    time.sleep(1.1)
    with socket.create_connection(("127.0.0.1", strict.port), timeout=LONG_S) as connection:
        connection.sendall(
            b"POST /v1/campaigns HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
            b"Transfer-Encoding: chunked\r\n\r\n"
        )
        for _ in range(100):
            connection.sendall(b"200\r\n" + b" " * 512 + b"\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 413")


def test_server_refuses_to_start_where_it_could_not_keep_anybody_out(tmp_path):
    environment = os.environ | {"RISK_SAC_DATA_DIR": str(tmp_path), "RISK_SAC_HOST": "0.0.0.0", "RISK_SAC_PORT": "1"}
    started = subprocess.run(
        [sys.executable, "-m", "service"], env=environment, capture_output=True, text=True, timeout=LONG_S
    )
    assert started.returncode == 2
    assert started.stderr.startswith("host: got '0.0.0.0'; ")
    assert list(tmp_path.iterdir()) == []
